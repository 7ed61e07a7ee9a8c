"""What several commands share: options, inputs, the terminal, run.json, exit codes."""
