"""Determines the settings of each object of a scene, and leaves out the objects that are not baked.

The settings of an object come from four sources. If several set the same key, the last source wins:

1. names of collision hulls and lower levels of detail, which set `exclude` (`baker.io.name_rules`);
2. `extras.baker` in the glTF file: of the object's ancestors from the root on, of its mesh, and of its node;
3. the setting `object` of the bake, in order;
4. the settings `include` and `exclude`.

A pattern that matches a node also applies to all nodes below it. So do the names and extras of a node.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field, replace
from typing import Any, Protocol

from baker.core.errors import InputError, SettingsError
from baker.core.object_materials import with_object_materials
from baker.core.object_settings import ObjectSettings, object_settings, parse_rule
from baker.core.readable import joined_names
from baker.core.scene import Instance, Scene, SceneWarning
from baker.core.settings import BakeSettings
from baker.core.source_mesh import SourceScene
from baker.io.name_rules import unseen_kind
from baker.io.node_names import NodeNames

# Member of `extras.baker` that belongs to `baker check` and is no object key.
_OTHER_KEYS = {"check"}


class ObjectChoice(Protocol):
    """The settings of a command that chooses objects and sets their settings."""

    @property
    def include(self) -> tuple[str, ...]:
        """Patterns of the objects that are kept; all if empty."""

    @property
    def exclude(self) -> tuple[str, ...]:
        """Patterns of objects and lights that are left out."""

    @property
    def object(self) -> tuple[str, ...]:
        """Rules, see `core.object_settings`."""

    @property
    def name_rules(self) -> bool:
        """Whether names leave out objects."""


@dataclass
class _Found:
    """The settings of an object, and where they come from."""

    values: dict[str, Any] = field(default_factory=dict)
    reasons: dict[str, str] = field(default_factory=dict)

    def add(self, values: Mapping[str, Any], reason: str) -> None:
        """Override settings."""
        self.values.update(values)
        self.reasons.update(dict.fromkeys(values, reason))

    @property
    def excluded(self) -> bool:
        """Return whether the object is left out."""
        return bool(self.values.get("exclude", False))


class _Rules:
    """Finds the settings of objects, and remembers which patterns matched."""

    def __init__(self, scene: Scene, settings: ObjectChoice) -> None:
        self.scene, self.settings = scene, settings
        self.names, self.by_name = NodeNames(scene), settings.name_rules
        self.rules = []
        for rule in settings.object:
            pattern, values = parse_rule(rule)
            given = object_settings(values, f"`object` '{rule}'")
            self.rules.append((pattern, {key: getattr(given, key) for key in values}))
        self.patterns = [*settings.include, *settings.exclude, *(pattern for pattern, _ in self.rules)]
        json = scene.source.json if scene.source is not None else {}
        self.meshes = json.get("meshes", [])
        holders = [*json.get("nodes", []), *self.meshes]
        self.has_extras = any(_baker_extras(holder) for holder in holders)

    def of(self, node: int, name: str, mesh_name: str, instance: Instance | None = None) -> _Found:
        """Return the settings of an object; `instance` may have settings from the file of a level's place."""
        found = _Found()
        if self.by_name:
            self._add_names(found, node, name, mesh_name)
        if instance is not None:
            for key in instance.settings.model_fields_set:
                found.add({key: getattr(instance.settings, key)}, instance.reasons[key])
        if self.has_extras:
            self._add_extras(found, node)
        self._add_patterns(found, node, name)
        included = [self.names.match(pattern, node, name) for pattern in self.settings.include]
        if included and not any(included):
            found.add({"exclude": True}, "no pattern of include matches it")
        return found

    def of_light(self, node: int, name: str) -> bool:
        """Return whether a light is left out."""
        found = _Found()
        self._add_patterns(found, node, name)
        for pattern in self.settings.include:
            self.names.match(pattern, node, name)
        return found.excluded

    def _add_names(self, found: _Found, node: int, name: str, mesh_name: str) -> None:
        above = [self.names.name(n) for n in self.names.ancestors(node)[:-1]]
        # The names of objects in a level are paths.
        for text in (*above, mesh_name, *name.split("/")):
            kind = unseen_kind(text)
            if kind is not None:
                found.add({"exclude": True}, f"the name '{text}' denotes a {kind}")

    def _add_extras(self, found: _Found, node: int) -> None:
        chain = self.names.ancestors(node)
        holders = [(self.names.json(n), f"node '{self.names.name(n)}'") for n in chain[:-1]]
        own = self.names.json(node)
        mesh = own.get("mesh")
        if isinstance(mesh, int) and mesh < len(self.meshes):
            holders.append((self.meshes[mesh], f"mesh '{self.meshes[mesh].get('name', f'mesh_{mesh}')}'"))
        for holder, label in [*holders, (own, f"node '{own.get('name', f'node_{node}')}'")]:
            values = self._extras(holder, label)
            if values:
                found.add(values, f"extras.baker of {label}")

    def _extras(self, holder: dict[str, Any], label: str) -> dict[str, Any]:
        """Return the validated settings in `extras.baker` of a node or mesh."""
        table = _baker_extras(holder)
        try:
            values = parse_rule(f"* {table}")[1] if isinstance(table, str) else table
            if not isinstance(values, dict):
                raise SettingsError(f"extras.baker is neither an object nor a text (was {values!r})")
            values = {key: value for key, value in values.items() if key not in _OTHER_KEYS}
            given = object_settings(values, "extras.baker")
        except SettingsError as error:
            path = self.scene.path
            raise InputError(error.message, file=str(path) if path else None, object=label) from None
        return {name: getattr(given, name) for name in given.model_fields_set}

    def _add_patterns(self, found: _Found, node: int, name: str) -> None:
        """Add the rules of `object` and the patterns of `exclude`."""
        for pattern, values in self.rules:
            if self.names.match(pattern, node, name):
                found.add(values, f"object '{pattern}'")
        for pattern in self.settings.exclude:
            if self.names.match(pattern, node, name):
                found.add({"exclude": True}, f"exclude '{pattern}'")

    def warnings(self) -> list[SceneWarning]:
        """Return a warning for each pattern that matches nothing.

        Raises
        ------
        InputError
            If it is a pattern of `include`.
        """
        unused = dict.fromkeys(p for p in self.patterns if p not in self.names.matched)
        found = []
        for pattern in unused:
            message = f"the pattern '{pattern}' matches no object and no light{self.names.nearest(pattern)}"
            if pattern in self.settings.include:
                path = self.scene.path
                raise InputError(f"`include`: {message}", file=str(path) if path else None)
            found.append(SceneWarning("no-match", message, pattern))
        return found


def apply_object_settings(scene: Scene, settings: ObjectChoice) -> Scene:
    """Return the scene with the settings of each object, without the objects that are left out.

    Parameters
    ----------
    scene : Scene
        The scene; not changed.
    settings : ObjectChoice
        `include`, `exclude`, `object` and `name_rules` are used.

    Returns
    -------
    Scene
        The scene that is baked. Materials of objects are changed as their settings require.

    Raises
    ------
    InputError
        If no object is left, a pattern of `include` matches nothing, or extras in the file are invalid.
    """
    rules = _Rules(scene, settings)
    found = [rules.of(i.node, i.name, scene.meshes[i.mesh].name, i) for i in scene.instances]
    if found and all(own.excluded for own in found):
        # A file of nothing but a hull or a lower level of detail is baked like others.
        rules.by_name = False
        found = [rules.of(i.node, i.name, scene.meshes[i.mesh].name, i) for i in scene.instances]
    lights = tuple(light for light in scene.lights if not rules.of_light(light.node, light.name))
    # Call this before `warnings`: a pattern may match an instance that only the source scene contains.
    source = _choose_source(scene.source_scene, rules)
    if not any(f.values for f in found) and not rules.patterns and source is scene.source_scene:
        return scene
    instances = [
        replace(instance, settings=ObjectSettings(**own.values), reasons=own.reasons)
        if own.values
        else instance
        for instance, own in zip(scene.instances, found, strict=True)
    ]
    warnings = [*_left_out_by_name(instances), *rules.warnings()]
    kept = [i for i in instances if not i.settings.exclude]
    if scene.instances and not kept:
        reason = next(iter(i.reasons["exclude"] for i in instances))
        advice = "`baker inspect` with `objects` lists the reasons"
        message = f"no object is left to bake, because {reason}; {advice}"
        raise InputError(message, file=str(scene.path) if scene.path else None)
    left = replace(scene, lights=lights, source_scene=source, warnings=(*scene.warnings, *warnings))
    return with_object_materials(choose_instances(left, instances))


def apply_recorded(scene: Scene, manifest: Mapping[str, Any]) -> Scene:
    """Return the scene of a bake with the settings of each object that the manifest records.

    Parameters
    ----------
    scene : Scene
        All objects of `scene.glb`.
    manifest : mapping
        The content of `bake.json`. If it has no `objects`, the patterns in its settings are applied.

    Returns
    -------
    Scene
        The scene that was baked.

    Raises
    ------
    SettingsError
        If a recorded setting is invalid.
    """
    known = manifest["settings"]
    patterns = {key: known[key] for key in ("include", "exclude", "object") if known.get(key)}
    rules = _Rules(scene, BakeSettings(**patterns, name_rules=False))
    rows = manifest.get("objects")
    if rows is None:
        given = {i.node: rules.of(i.node, i.name, "") for i in scene.instances}
        rows = [{"node": node, "settings": found.values} for node, found in given.items() if found.values]
    recorded = {row["node"]: row for row in rows}
    instances = [
        replace(
            instance,
            settings=object_settings(recorded[instance.node]["settings"], "objects"),
            reasons=recorded[instance.node].get("reasons", {}),
        )
        if instance.node in recorded
        else instance
        for instance in scene.instances
    ]
    lights = tuple(light for light in scene.lights if not rules.of_light(light.node, light.name))
    return with_object_materials(choose_instances(replace(scene, lights=lights), instances))


def with_extras(scene: Scene) -> Scene:
    """Return the scene with the settings that extras in the file give to its instances, not yet applied.

    Parameters
    ----------
    scene : Scene
        A scene that becomes part of a level, which has no document.

    Returns
    -------
    Scene
        `scene` itself if the file has no such extras.

    Raises
    ------
    InputError
        If the extras are invalid.
    """
    rules = _Rules(scene, BakeSettings(name_rules=False))
    if not rules.has_extras:
        return scene
    found = [rules.of(i.node, i.name, "") for i in scene.instances]
    instances = [
        replace(i, settings=ObjectSettings(**own.values), reasons=own.reasons)
        for i, own in zip(scene.instances, found, strict=True)
    ]
    return replace(scene, instances=tuple(instances))


def choose_instances(scene: Scene, instances: list[Instance]) -> Scene:
    """Return the scene with `instances`; those with the setting `exclude` become `Scene.left_out`.

    Parameters
    ----------
    scene : Scene
        The scene.
    instances : list of Instance
        The instances of the scene, with their settings.

    Returns
    -------
    Scene
        Without unused meshes.
    """
    kept = [i for i in instances if not i.settings.exclude]
    left_out = [i for i in instances if i.settings.exclude]
    # Without a source document, the writer of scene.glb needs the meshes of all objects.
    written = left_out if scene.source is None else []
    used = [*sorted({i.mesh for i in kept}), *sorted({i.mesh for i in written} - {i.mesh for i in kept})]
    number = {old: new for new, old in enumerate(used)}
    return replace(
        scene,
        meshes=tuple(scene.meshes[k] for k in used),
        instances=tuple(replace(i, mesh=number[i.mesh]) for i in kept),
        left_out=tuple(replace(i, mesh=number.get(i.mesh, -1)) for i in left_out),
    )


def _choose_source(source: SourceScene | None, rules: _Rules) -> SourceScene | None:
    """Return a source scene without the instances that are left out."""
    if source is None:
        return None
    shown = [i for i in source.instances if not rules.of(i.node, i.name, source.meshes[i.mesh].name).excluded]
    if len(shown) == len(source.instances):
        return source
    used = sorted({i.mesh for i in shown})
    number = {old: new for new, old in enumerate(used)}
    return SourceScene(
        tuple(source.meshes[k] for k in used), tuple(replace(i, mesh=number[i.mesh]) for i in shown)
    )


def _left_out_by_name(instances: list[Instance]) -> list[SceneWarning]:
    """Return a note about the objects that are left out because of their names."""
    names = [i.name for i in instances if i.settings.exclude and i.reasons["exclude"].startswith("the name")]
    if not names:
        return []
    verb = "is" if len(names) == 1 else "are"
    message = (
        f"{joined_names(names)} {verb} left out, because the name denotes a collision hull or a lower level"
        " of detail; `name_rules=False` bakes such objects"
    )
    return [SceneWarning("left-out-by-name", message, names[0] if len(names) == 1 else "")]


def _baker_extras(holder: Any) -> Any:
    """Return `extras.baker` of a node or mesh, {} if it is missing."""
    extras = holder.get("extras") if isinstance(holder, dict) else None
    return extras.get("baker", {}) if isinstance(extras, dict) else {}
