"""Divides the objects of a scene into groups that share pages, and joins the atlases of the groups.

Objects without the key `group` are the first group. The objects with `receive = false` are the last group.
Their pages are hidden: the bake computes light on them, because rays that hit these objects read it there,
but it does not write them.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from baker.core.atlas import Atlas, InstanceLayout
from baker.core.errors import SettingsError
from baker.core.progress import Progress
from baker.core.scene import Scene
from baker.core.settings import BakeSettings

# Density of hidden pages, divided by the mean density of the other pages. The light of hidden pages is only
# seen reflected, as a mean over many hits.
_HIDDEN_DENSITY = 0.5


@dataclass(frozen=True)
class PageGroup:
    """Objects that share pages.

    Attributes
    ----------
    members : tuple of int
        Indices of the instances, ascending.
    hidden : bool
        Whether the pages are hidden.
    """

    members: tuple[int, ...]
    hidden: bool = False


def page_groups(scene: Scene) -> list[PageGroup]:
    """Return the groups of a scene's instances, in the order of their pages.

    Parameters
    ----------
    scene : Scene
        The scene, with the settings of its instances.

    Returns
    -------
    list of PageGroup
        Objects without a group, the named groups in the order of their first objects, and hidden objects.
    """
    named: dict[str, list[int]] = {"": []}
    hidden = []
    for k, instance in enumerate(scene.instances):
        if instance.settings.receive:
            named.setdefault(instance.settings.group, []).append(k)
        else:
            hidden.append(k)
    groups = [PageGroup(tuple(members)) for members in named.values() if members]
    return groups + ([PageGroup(tuple(hidden), hidden=True)] if hidden else [])


def settings_of_group(settings: BakeSettings, n_used: int, n_later: int) -> BakeSettings:
    """Return the settings with the number of pages that a group may use.

    Parameters
    ----------
    settings : BakeSettings
        Settings of the bake.
    n_used : int
        Number of pages of earlier groups.
    n_later : int
        Number of later groups, each of which needs at least one page.

    Returns
    -------
    BakeSettings
        The settings of the group.

    Raises
    ------
    SettingsError
        If there are more groups than pages.
    """
    if n_used == n_later == 0:
        return settings
    left = settings.max_pages - n_used - n_later
    if left < 1:
        message = "each group of objects needs a page, and there are more groups than `max_pages`"
        raise SettingsError(message, object="max_pages")
    budget = None if settings.budget is None else f"{left}x{settings.resolution}"
    return settings.changed(max_pages=left, budget=budget)


def hidden_density(atlases: Sequence[Atlas]) -> float:
    """Return the largest density of hidden pages, texels per metre.

    Parameters
    ----------
    atlases : sequence of Atlas
        The atlases of all other groups.

    Returns
    -------
    float
        Above 0.
    """
    found = [layout.texels_per_metre for atlas in atlases for layout in atlas.layouts if len(layout.triangle)]
    return _HIDDEN_DENSITY * float(np.median(found)) if found else 1.0


def part_of_progress(progress: Progress, number: int, count: int) -> Progress:
    """Return a callback for part `number` of `count` equal parts of a stage.

    Parameters
    ----------
    progress : Progress
        The callback of the whole stage.
    number : int
        Number of the part, from 0.
    count : int
        Number of parts.

    Returns
    -------
    Progress
        `progress` itself if there is one part.
    """
    if count == 1:
        return progress

    def part(stage: str, fraction: float, detail: str = "", /) -> object:
        return progress(stage, (number + fraction) / count, detail)

    return part


def join_atlases(scene: Scene, groups: Sequence[PageGroup], atlases: Sequence[Atlas]) -> Atlas:
    """Return one atlas with the pages of all groups, one group after the other.

    Parameters
    ----------
    scene : Scene
        The scene.
    groups : sequence of PageGroup
        The groups.
    atlases : sequence of Atlas
        The atlas of each group, whose layouts are in the order of the group's members.

    Returns
    -------
    Atlas
        With a layout for each instance of the scene.
    """
    if len(groups) == 1 and not groups[0].hidden:
        return atlases[0]
    layouts: dict[int, InstanceLayout] = {}
    n_pages = n_charts = n_hidden = n_shared = 0
    for group, atlas in zip(groups, atlases, strict=True):
        numbers = [layout.shared.number for layout in atlas.layouts if layout.shared is not None]
        for member, layout in zip(group.members, atlas.layouts, strict=True):
            shared = layout.shared
            if shared is not None:
                shared = replace(shared, number=shared.number + n_shared)
            layouts[member] = replace(
                layout,
                instance=member,
                page=layout.page + n_pages,
                chart=layout.chart + np.int32(n_charts),
                receives=not group.hidden,
                shared=shared,
            )
        n_shared += max(numbers, default=-1) + 1
        n_pages += atlas.n_pages
        n_charts += atlas.n_charts
        n_hidden += atlas.n_pages if group.hidden else 0
    return replace(
        atlases[0],
        n_pages=n_pages - n_hidden,
        layouts=tuple(layouts[k] for k in range(len(scene.instances))),
        n_charts=n_charts,
        warnings=tuple(
            warning
            for group, atlas in zip(groups, atlases, strict=True)
            if not group.hidden
            for warning in atlas.warnings
        ),
        n_hidden=n_hidden,
    )
