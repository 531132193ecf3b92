"""A fitted elastomer put into a scene's file: modulus and spectrum change, all else, comments included, stays."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Any

from pgfmd.errors import ResultError
from pgfmd.files.regular_files import write_atomically
from pgfmd.files.text import read_text
from pgfmd.scene.model import Rheology
from pgfmd.scene.reading import parse_scene
from pgfmd.scene.unresolved_scene import Given

if TYPE_CHECKING:
    from .rheology_table import Material


def poisson_ratio_of(scene: Path) -> float | None:
    """Poisson's ratio of a scene's file; None where it has none that can be used. SceneError for what is no TOML file."""
    substrate = Given.read(scene).mapping.get("substrate")
    found = substrate.get("poisson_ratio") if isinstance(substrate, dict) else None
    return float(found) if isinstance(found, (int, float)) and -1.0 < found <= 0.5 else None


def text_with(scene: Path, material: Material) -> str:
    """The text of a scene's file with the material's modulus and series in it.

    Raises SceneError for a file that is no scene, before or after that.
    """
    import tomlkit

    Given.read(scene)  # says what is wrong with a file that can't be read
    document = tomlkit.parse(read_text(scene))
    _section(document, "substrate")["youngs_modulus"] = material.youngs_modulus
    rheology, wanted = _section(document, "rheology"), material.written_rheology()
    for key in Rheology.model_fields:
        if key in rheology and key not in wanted:
            del rheology[key]
    for key, value in wanted.items():
        rheology[key] = value
    text = tomlkit.dumps(document)
    parse_scene(text, source=f"{scene}, with the fit in it", folder=scene.parent, require_files=False)
    return text


def write_into(scene: Path, material: Material) -> None:
    """Replaces a scene's file by `text_with`, in UTF-8. Raises SceneError, and ResultError if it can't be written."""
    text = text_with(scene, material)
    try:
        write_atomically(scene, text.encode())
    except OSError as error:
        raise ResultError(f"{scene}: could not be written: {error.strerror}") from None


def _section(document: Any, name: str) -> Any:
    """A table of a document, added at its end if there is none."""
    if name not in document:
        import tomlkit

        document[name] = tomlkit.table()
    return document[name]
