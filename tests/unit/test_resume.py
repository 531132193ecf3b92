"""What a results folder whose checkpoints are all damaged says, before anything is computed."""

import pytest

from pgfmd.errors import ResultError, SceneError
from pgfmd.files.storage import SCENE_FILE
from pgfmd.restart.resume import plan
from pgfmd.restart.scene_changes import contents_of, differing, review
from pgfmd.scene import load_scene
from tests.unit.small_runs import SCENE, flip, run

CURE = "Start anew with --fresh, which keeps the old results"


@pytest.fixture(scope="module")
def runs(tmp_path_factory):
    """A run that was stopped on its way in, whose seals are broken."""
    folder = tmp_path_factory.mktemp("runs")
    for path in run(folder / "stopped", stop_after=20).glob("checkpoint*.h5"):
        flip(path, 10)
    return folder


def scene(*changes):
    return load_scene(SCENE[0], [*SCENE[1:], *changes])


def test_without_a_valid_checkpoint_the_changed_keys_are_told(stopped):
    with pytest.raises(ResultError) as caught:
        run(stopped, "grid.n=32")
    text = str(caught.value)
    assert text.startswith(f"no valid checkpoint to go on from:\n  - {stopped}/checkpoint.h5: ")
    assert "The scene is not that of the run, either: grid.n = 32, the run's is 24.\n" in text
    assert text.endswith(CURE) and "fields.h5" not in text


def test_the_same_scene_has_no_changed_keys(stopped):
    with pytest.raises(ResultError) as caught:
        plan(stopped, scene(), False, ())
    assert "The scene" not in str(caught.value) and str(caught.value).endswith(CURE)


@pytest.mark.parametrize("text", [None, "no TOML"])
def test_a_lost_scene_hides_no_message(stopped, text):
    path = stopped / SCENE_FILE
    path.unlink() if text is None else path.write_text(text)
    with pytest.raises(ResultError, match="no valid checkpoint") as caught:
        plan(stopped, scene("grid.n=32"), False, ())
    assert "The scene" not in str(caught.value)


def test_fresh_begins_anew(stopped):
    assert not plan(stopped, scene("grid.n=32"), True, ()).go_on
    assert (stopped / "previous-1" / SCENE_FILE).exists()


def test_files_count_by_their_contents_where_these_are_known(tmp_path):
    paths = [tmp_path / name for name in ("one.txt", "other.txt")]
    for path in paths:
        path.write_text("1e3 1e-9\n1e6 1e-12\n")
    one, other = (scene(f"substrate.compliance_file={path}") for path in paths)
    keys = [key for key, _, _ in differing(one.to_toml(), other)]
    assert keys == ["substrate.compliance_file"]
    assert not list(differing(one.to_toml(), other, contents_of(one)))
    head = {"scene": one.to_toml(), "files": contents_of(one)}
    paths[1].write_text("1e3 1e-9\n1e6 2e-12\n")
    with pytest.raises(SceneError, match="compliance_file"):
        review(head, other, (), tmp_path)
