"""A running bake reports expected durations, compilation, and texels whose light did not converge."""

from __future__ import annotations

import numpy as np
import pytest
from io_scenes import write_timed_bake

from baker.checks.bake_rates import RAY_STAGES
from baker.checks.stage_seconds import stage_seconds
from baker.core.lightmap import TexelStatus
from baker.core.settings import BakeSettings
from baker.core.stage import COMPILING, Stage
from baker.pipeline.pages import convergence_warnings
from baker.pipeline.precompile import labelled


class Running:
    """A process that runs until `code` is set."""

    code: int | None = None

    def poll(self) -> int | None:
        return self.code


def test_reports_at_the_start_of_a_stage_say_that_kernels_are_compiled() -> None:
    seen: list[tuple[object, ...]] = []
    process = Running()
    report = labelled(process, lambda *words: seen.append(words))  # type: ignore[arg-type]
    report(Stage.TEXELS, 0.0, "")
    report(Stage.TEXELS, 0.5, "3 Mrays/s")
    process.code = 0
    report(Stage.FINISH, 0.0, "")
    assert seen == [
        (Stage.TEXELS, 0.0, COMPILING),
        (Stage.TEXELS, 0.5, "3 Mrays/s"),
        (Stage.FINISH, 0.0, ""),
    ]
    assert labelled(None, report) is report


@pytest.mark.parametrize(("unconverged", "warned"), [(0, False), (10, False), (11, True), (1000, True)])
def test_more_than_one_percent_of_noisy_texels_is_a_warning(unconverged: int, warned: bool) -> None:
    status = np.full((2, 40, 40), TexelStatus.EMPTY, np.uint8)
    status[0, :25] = TexelStatus.COVERED
    # Dilated texels do not lie on a surface and are not counted.
    status[1] = TexelStatus.DILATED
    status[0].reshape(-1)[:unconverged] = TexelStatus.UNCONVERGED
    found = convergence_warnings(status)
    assert [w.code for w in found] == ["not-converged"] * warned
    for warning in found:
        assert warning.message.startswith(f"{unconverged / 10:g} % of the texels did not converge")
        assert "raise `quality` if you see any" in warning.message


def test_expected_seconds_have_the_stages_of_the_settings_in_their_order(tmp_path) -> None:
    scene = tmp_path / "a.glb"
    both = stage_seconds(BakeSettings(), scene)
    assert list(both) == [stage for stage in Stage if stage in both]
    assert {Stage.UNWRAP, Stage.DIRECT_LIGHT, Stage.FORM_FACTORS, Stage.FINAL_GATHER, Stage.FINISH} <= set(
        both
    )
    occlusion = stage_seconds(BakeSettings(channels="ao"), scene)
    assert {Stage.AMBIENT_OCCLUSION} == set(occlusion) & set(RAY_STAGES) - {Stage.INSIDE_GEOMETRY}
    finer = stage_seconds(BakeSettings(resolution=2048, samples=256), scene)
    assert finer[Stage.FINAL_GATHER] == pytest.approx(16 * both[Stage.FINAL_GATHER], rel=1e-3)
    assert stage_seconds(BakeSettings(denoise=False), scene)[Stage.FINISH] < both[Stage.FINISH]


def test_the_speed_of_an_earlier_bake_of_the_scene_is_used(tmp_path) -> None:
    scene = tmp_path / "a.glb"
    default = stage_seconds(BakeSettings(), scene)
    write_timed_bake(
        tmp_path / "out",
        100,
        input={"path": "../a.glb", "sha256": None},
        timings={"final gather": 5.0, "finish": 2.0, "texels": 1.0},
        rays={"final gather": 1000},
    )
    found = stage_seconds(BakeSettings(), scene)
    texels = 0.8 * 1024**2
    assert found[Stage.FINAL_GATHER] == pytest.approx(texels * 64 * 0.005, rel=1e-3)
    assert found[Stage.FINISH] == pytest.approx(texels * 0.02, rel=1e-3)
    assert found[Stage.TEXELS] == pytest.approx(texels * 0.01, rel=1e-3)
    assert found[Stage.DIRECT_LIGHT] == default[Stage.DIRECT_LIGHT]


def test_a_loop_of_links_has_expected_seconds_too(tmp_path) -> None:
    loop = tmp_path / "loop.glb"
    loop.symlink_to(loop)
    assert stage_seconds(BakeSettings(), loop) == stage_seconds(BakeSettings(), tmp_path / "a.glb")
