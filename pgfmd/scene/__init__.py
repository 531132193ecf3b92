"""Scenes: TOML files or shipped names, checked key by key, with every problem told at once. No MPI."""

from .reading import Scene, load_scene, parse_scene, scene_from_mapping, shipped_scenes, shipped_text

__all__ = ["Scene", "load_scene", "parse_scene", "scene_from_mapping", "shipped_scenes", "shipped_text"]
