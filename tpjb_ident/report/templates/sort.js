"use strict";
// Tables sort by a click on a column's head. Without this script they are complete, in the order of the report.
for (const table of document.querySelectorAll("main table:not(.facts)")) {
  const body = table.tBodies[0];
  if (!table.tHead || !body || body.rows.length < 3) continue;
  const order = [...body.rows];
  const compare = new Intl.Collator("en", { numeric: true }).compare;
  const number = (text) => {
    const match = text.replace(/\u2212/g, "-").match(/^\s*#?([-+]?\d+(?:\.\d+)?(?:e[-+]?\d+)?)/i);
    return match ? Number(match[1]) : NaN;
  };
  [...table.tHead.rows[0].cells].forEach((head, column) => {
    if (!head.textContent.trim()) return;
    const button = document.createElement("button");
    button.type = "button";
    button.append(...head.childNodes);
    head.append(button);
    button.addEventListener("click", () => {
      const next = { none: "ascending", ascending: "descending", descending: "none" };
      const way = next[head.getAttribute("aria-sort") || "none"];
      for (const other of table.tHead.rows[0].cells) other.removeAttribute("aria-sort");
      if (way !== "none") head.setAttribute("aria-sort", way);
      const sign = way === "descending" ? -1 : 1;
      const rows = way === "none" ? order : [...order].sort((a, b) => {
        const [p, q] = [a.cells[column].textContent, b.cells[column].textContent];
        const [m, n] = [number(p), number(q)];
        if (Number.isNaN(m) !== Number.isNaN(n)) return Number.isNaN(m) ? 1 : -1; // what is no number stays below
        return sign * (m !== n && !Number.isNaN(m) ? m - n : compare(p, q));
      });
      body.append(...rows);
    });
  });
}
