"""The pad as a solid: algebra, symmetry, heat balance, grids, cache, operators over what its free faces convect."""

import dataclasses
import math

import numpy as np
import pytest

from model.bearing import STEEL, Bearing, Material, Oil, Pad, Pivot
from model.pad import operators as operators_module
from model.pad import store as pad_store
from model.pad.mesh import MeshDensity, PadGeometry, PivotFace, pivot_face, sector_mesh
from model.pad.operators import LARGEST, conduct, pad_operators
from tests.pad_responses import PadResponse, pad_solid

COARSE = MeshDensity(arc=6, face=1, half_length=3, backing=2)
COARSEST = MeshDensity(2, 1, 3, 1)
OIL = Oil(0.0396, 0.034, 860.0, 7e-4, 2000.0, 0.13, 40.0)
PAD = Pad(-math.pi / 2, math.radians(63.5), 0.5, 0.13e-3, 0.08e-3, 16e-3, 3e-3, 16e-3, 0.54, 0.256e-3)
ROCKER = Pivot("rocker", contact_length=39.6e-3, housing_diameter=0.132, pivot_diameter=0.1196)
SPHERE = Pivot("spherical", sphere_diameter=0.4)


def bearing(pivot: Pivot = ROCKER) -> Bearing:
    return Bearing("test", 99.86e-3, 69.6e-3, (PAD,), pivot, OIL)


@pytest.fixture(autouse=True)
def _no_files(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("TPJB_CACHE", "off")


def grids(pad: Pad = PAD, n_theta: int = 25, n_z: int = 7, full: bool = False) -> tuple[np.ndarray, np.ndarray]:
    theta = pad.leading_edge + pad.arc * np.linspace(0.0, 1.0, n_theta)
    half = 0.5 * 69.6e-3
    return theta, np.linspace(-half if full else 0.0, half, 2 * n_z - 1 if full else n_z)


def solid(pad: Pad = PAD, pivot: Pivot = ROCKER, **grid: object) -> PadResponse:
    return pad_solid(pad, bearing(pivot), *grids(pad, **grid), density=COARSE)  # type: ignore[arg-type]


def film_pressure(body: PadResponse) -> np.ndarray:
    s = (body.film_theta - body.film_theta[0]) / np.ptp(body.film_theta)
    z = body.film_z / body.film_z[-1]
    return 3e6 * np.sin(np.pi * s)[:, None] * (1.0 - z**2)


class TestCompliance:
    @pytest.mark.parametrize("full", [False, True])
    def test_work_is_symmetric_and_never_negative(self, full: bool) -> None:
        body = solid(full=full)
        work = body.film_mass @ body.compliance
        scale = np.abs(work).max()
        np.testing.assert_allclose(work, work.T, atol=1e-12 * scale)
        assert np.linalg.eigvalsh(0.5 * (work + work.T)).min() > -1e-12 * scale

    def test_half_film_stands_for_the_whole(self) -> None:
        half, full = solid(), solid(full=True)
        p = film_pressure(half)
        whole = full.bend(np.concatenate((p[:, :0:-1], p), axis=1))
        np.testing.assert_allclose(whole[:, 6:], half.bend(p), rtol=1e-11)
        np.testing.assert_allclose(whole, whole[:, ::-1], rtol=1e-11)

    def test_one_sided_film_bends_that_side_more(self) -> None:
        full = solid(full=True)
        p = film_pressure(full) * (full.film_z > 0)
        got = full.bend(p)
        mirrored = full.bend(p[:, ::-1])
        np.testing.assert_allclose(got, mirrored[:, ::-1], rtol=1e-10, atol=1e-12 * got.max())
        assert got[0, -1] > 1.2 * got[0, 0]

    def test_film_grid_hardly_matters(self) -> None:
        fine, coarse = solid(n_theta=49, n_z=13), solid(n_theta=25, n_z=7)
        expected = coarse.bend(film_pressure(coarse))
        np.testing.assert_allclose(fine.bend(film_pressure(fine))[::2, ::2], expected, atol=0.01 * expected.max())

    def test_uneven_film_grid_and_constant_field(self) -> None:
        theta, _ = grids()
        z = 0.5 * 69.6e-3 * np.linspace(0.0, 1.0, 7) ** 1.5
        ones, even = np.ones((25, 7)), solid().bend(np.ones((25, 7)))
        uneven = pad_solid(PAD, bearing(), theta, z, density=COARSE).bend(ones)
        np.testing.assert_allclose(uneven[:, 0], even[:, 0], rtol=0.01, atol=0.003 * even.max())


class TestHeat:
    def test_no_convection_no_gradient(self) -> None:
        body = solid(dataclasses.replace(PAD, back_convection=0.0))
        rise = np.full((25, 7), 12.0)
        assert body.pad_temperature(rise)[2] == pytest.approx(12.0)
        assert np.abs(body.heat_flow(rise)).max() < 1e-6
        assert body.back_temperature(rise) == pytest.approx(12.0)

    def test_heat_in_is_heat_out(self) -> None:
        geometry = PadGeometry.of(PAD, bearing())
        mesh = sector_mesh(geometry, COARSE)
        rise = np.linspace(5.0, 9.0, mesh.n_surface)[:, None]
        temperature, heat = conduct(mesh, geometry.back_convection, rise)
        field = temperature[..., 0]
        r, theta, z = mesh.r, mesh.theta, mesh.z
        whole_r, whole_t, whole_z = (line.matrix(0, 0).sum(axis=0) for line in (r, theta, z))
        weighted_r = r.matrix(0, 0, r.gauss[0]).sum(axis=0)
        back = r.breaks[-1] * np.einsum("i,k,ik", whole_t, whole_z, field[:, -1])
        end = np.einsum("i,j,ij", whole_t, weighted_r, field[:, :, -1])
        edges = np.einsum("j,k,jk", whole_r, whole_z, field[0] + field[-1])
        assert heat.sum() == pytest.approx(geometry.back_convection * (back + end + edges), rel=1e-10)

    def test_radial_conduction_far_from_the_edges(self) -> None:
        """T(R_o) / T(R_i) = 1 / (1 + h R_o ln(R_o / R_i) / k), a cylindrical wall."""
        thin = dataclasses.replace(
            PAD, thickness=4e-3, elastic_thickness=4e-3, babbitt_thickness=0.0, back_convection=2e4
        )
        mesh = sector_mesh(PadGeometry.of(thin, bearing()), MeshDensity(backing=2))
        middle = mesh.theta.n_nodes // 2
        rise = conduct(mesh, 2e4, np.ones((mesh.n_surface, 1)))[0][middle, -1, 0, 0]
        inner, outer = mesh.r.breaks[[0, -1]]
        assert rise == pytest.approx(1.0 / (1.0 + 2e4 * outer * math.log(outer / inner) / STEEL.conductivity), rel=1e-3)

    def test_flux_adds_up_to_the_heat(self) -> None:
        body = solid(full=True)
        rise = 5.0 + body.film_theta[:, None] * np.ones(body.film_z.size)
        total = (body.film_mass @ body.heat_flow(rise).ravel()).sum()
        geometry = body.geometry
        mesh = sector_mesh(geometry, COARSE)
        heat = conduct(mesh, geometry.back_convection, np.ones((mesh.n_surface, 1)))[1]
        assert total == pytest.approx(2.0 * heat.sum() * 5.0, rel=1e-9)
        assert body.pad_temperature(rise)[2].max() <= rise.max() * 1.01

    def test_odd_temperatures_vanish_in_the_middle(self) -> None:
        body = solid(full=True)
        rise = np.ones((25, 1)) * body.film_z[None, :] / body.film_z[-1]
        grow = body.expand(rise)
        np.testing.assert_allclose(grow, -grow[:, ::-1], atol=1e-10 * np.abs(grow).max())
        flow = body.heat_flow(rise)
        np.testing.assert_allclose(flow, -flow[:, ::-1], atol=1e-9 * np.abs(flow).max())


class TestGeometry:
    def test_faces_by_pivot_kind(self) -> None:
        rocker = pivot_face(PAD, bearing())
        assert (rocker.width, rocker.length) == pytest.approx((8e-3, 39.6e-3))
        sphere = pivot_face(PAD, bearing(SPHERE))
        assert sphere.width * sphere.length == pytest.approx(math.pi / 4 * 16e-3**2)
        assert pivot_face(PAD, bearing(Pivot("rigid"))).length == 69.6e-3

    def test_face_gives_way_on_a_short_pad(self) -> None:
        short = dataclasses.replace(PAD, arc=math.radians(15.0), pivot_offset=0.8)
        face = pivot_face(short, bearing())
        assert face.width < 8e-3
        assert np.isfinite(solid(short).bend(np.ones((25, 7)))).all()

    def test_offset_pivot_and_full_length_strip(self) -> None:
        offset = dataclasses.replace(PAD, pivot_offset=0.6)
        body = pad_solid(offset, bearing(Pivot("rigid")), *grids(offset), density=COARSE)
        there = np.zeros((25, 7))
        there[body.film_theta < offset.leading_edge + 0.5 * offset.arc] = 1e6
        u_long, u_short = body.bend(there), body.bend(there[::-1])
        assert u_long[0, 0] > 1.3 * u_short[-1, 0] > 0.0  # the longer wing is the softer one

    def test_face_must_fit(self) -> None:
        with pytest.raises(ValueError, match="does not fit"):
            dataclasses.replace(PadGeometry.of(PAD, bearing()), face=PivotFace(0.2, 0.01))
        with pytest.raises(ValueError, match="does not fit"):
            PadGeometry.of(dataclasses.replace(PAD, pivot_offset=0.0), bearing())

    def test_micron_changes_share_a_solution(self) -> None:
        moved = dataclasses.replace(PAD, pad_clearance=PAD.pad_clearance + 5e-6, assembled_clearance=60e-6)
        assert PadGeometry.of(moved, bearing()) == PadGeometry.of(PAD, bearing())


class TestStore:
    @pytest.fixture
    def counted(self, monkeypatch: pytest.MonkeyPatch) -> list[int]:
        calls: list[int] = []
        original = operators_module._solve

        def spy(*args: object) -> dict[str, np.ndarray]:
            calls.append(1)
            return original(*args)  # type: ignore[arg-type]

        monkeypatch.setattr(operators_module, "_solve", spy)
        return calls

    @staticmethod
    def fresh() -> np.ndarray:
        operators_module.operators_at.cache_clear()
        return pad_operators(PadGeometry.of(PAD, bearing()), COARSEST, True).compliance

    def test_second_process_reads_the_file(self, tmp_path, monkeypatch, counted) -> None:
        monkeypatch.setenv("TPJB_CACHE", str(tmp_path / "deep" / "folder"))
        first, second = self.fresh(), self.fresh()
        assert len(counted) == 1
        np.testing.assert_array_equal(first, second)
        assert [path.suffix for path in (tmp_path / "deep" / "folder").iterdir()] == [".npz"]

    @pytest.mark.slow
    @pytest.mark.parametrize("damage", [b"", b"not a zip", b"PK\x03\x04 cut off", None])
    def test_damaged_file_is_solved_again(self, tmp_path, monkeypatch, counted, damage) -> None:
        monkeypatch.setenv("TPJB_CACHE", str(tmp_path))
        first = self.fresh()
        (path,) = tmp_path.glob("*.npz")
        if damage is None:  # whole, with a number that no pad has
            with np.load(path) as stored:
                arrays = dict(stored)
            arrays["compliance"][0, 0] = np.nan
            np.savez(path, **arrays)
        else:
            path.write_bytes(damage)
        np.testing.assert_array_equal(first, self.fresh())
        assert len(counted) == 2

    def test_any_damaged_byte_gives_the_same_or_nothing(self, tmp_path, monkeypatch) -> None:
        monkeypatch.setenv("TPJB_CACHE", str(tmp_path))
        arrays = {"a": np.arange(6.0)}
        assert pad_store.save_arrays("k", arrays)
        whole = (tmp_path / "pad-k.npz").read_bytes()
        answers = []
        for place in range(len(whole)):  # a zip may also say that it is encrypted, or of a version to come
            for flipped in (1, 8, 255):
                damaged = bytes([*whole[:place], whole[place] ^ flipped, *whole[place + 1 :]])
                (tmp_path / "pad-k.npz").write_bytes(damaged)
                answers.append(pad_store.load_arrays("k", {"a": (6,)}))
        loaded = [answer for answer in answers if answer is not None]
        assert all((answer["a"] == arrays["a"]).all() for answer in loaded)
        assert 0 < len(loaded) < len(answers)

    def test_unwritable_folder_is_no_error(self, tmp_path, monkeypatch, counted) -> None:
        (tmp_path / "file").write_text("in the way")
        monkeypatch.setenv("TPJB_CACHE", str(tmp_path / "file" / "folder"))
        assert np.isfinite(self.fresh()).all()
        assert len(counted) == 1

    def test_old_files_are_pruned(self, tmp_path, monkeypatch) -> None:
        monkeypatch.setenv("TPJB_CACHE", str(tmp_path))
        assert pad_store.save_arrays("0" * 32, {"a": np.zeros(2)})
        (size,) = (path.stat().st_size for path in tmp_path.iterdir())
        monkeypatch.setattr(pad_store, "_MOST", 3 * size)
        for i in range(1, 6):
            assert pad_store.save_arrays(f"{i:032d}", {"a": np.zeros(2)})
        assert len(list(tmp_path.iterdir())) == 3

    def test_key_follows_geometry(self) -> None:
        one, two = PadGeometry.of(PAD, bearing()), PadGeometry.of(PAD, bearing(SPHERE))
        assert pad_store.storage_key(one) != pad_store.storage_key(two)
        assert pad_store.storage_key(one) == pad_store.storage_key(PadGeometry.of(PAD, bearing()))

    def test_folder_follows_the_environment(self, monkeypatch) -> None:
        assert pad_store.cache_folder() is None
        monkeypatch.delenv("TPJB_CACHE")
        folder = pad_store.cache_folder()
        assert folder is None or folder.name == "tpjb-ident"


def test_materials_reach_the_solution() -> None:
    odd = dataclasses.replace(PAD, backing=Material(206e9, 0.3, 12e-6, 5.4))
    rise = np.ones((25, 7))
    assert solid(odd).back_temperature(rise)[12, 0] < solid().back_temperature(rise)[12, 0]


@pytest.mark.slow
@pytest.mark.parametrize("even", [True, False])
def test_operators_between_the_nodes_of_convection_are_those_of_a_solution(rocker, even):
    geometry = PadGeometry.of(rocker.pads[0], rocker)
    for convection in (0.0, 20.0, 50.0, 137.0, 500.0, 1500.0, 8000.0):
        own = dataclasses.replace(geometry, back_convection=convection)
        exact, near = pad_operators(own, COARSEST, even), pad_operators(own, COARSEST, even, cooled=True)
        np.testing.assert_allclose(near.compliance, exact.compliance, rtol=1e-9, atol=1e-20)
        np.testing.assert_allclose(near.expansion, exact.expansion, atol=5e-6 * np.abs(exact.expansion).max())
        np.testing.assert_allclose(near.flux, exact.flux, atol=5e-5 * np.abs(exact.flux).max())
        if even:  # a film that is warmer all over: what it loses, small beside what goes from node to node
            lost, right = near.flux.sum(axis=1).mean(), exact.flux.sum(axis=1).mean()
            assert lost == pytest.approx(right, rel=5e-4, abs=1e-3)


def test_beyond_the_nodes_of_convection_a_pad_is_solved_for_its_own(rocker):
    geometry = dataclasses.replace(PadGeometry.of(rocker.pads[0], rocker), back_convection=3.0 * LARGEST)
    exact = pad_operators(geometry, COARSEST, True)
    np.testing.assert_array_equal(pad_operators(geometry, COARSEST, cooled=True).flux, exact.flux)
