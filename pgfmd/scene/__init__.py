"""Scenes: TOML files or shipped names, validated key by key, with all problems reported together. No MPI."""

from .reading import Scene, load_scene, parse_scene, scene_from_mapping, shipped_scenes, shipped_text

__all__ = ["Scene", "load_scene", "parse_scene", "scene_from_mapping", "shipped_scenes", "shipped_text"]
