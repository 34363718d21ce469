"""Looks up extensions: those of `baker.io.gltf.extensions`, and those that are only listed here."""

from __future__ import annotations

from baker.io.gltf.extension import EXTENSIONS, UNKNOWN, GltfExtension

# These change neither geometry nor base colour nor emission; files may require them.
_NO_EFFECT = (
    "KHR_animation_pointer",
    "KHR_materials_anisotropy",
    "KHR_materials_clearcoat",
    "KHR_materials_dispersion",
    "KHR_materials_iridescence",
    "KHR_materials_sheen",
    "KHR_materials_specular",
    "KHR_xmp_json_ld",
)
# These change materials but keep their base colour, and are ignored with a warning.
_LAYERS = (
    "ADOBE_materials_clearcoat_specular",
    "ADOBE_materials_clearcoat_tint",
    "ADOBE_materials_thin_transparency",
    "KHR_materials_diffuse_transmission",
    "KHR_materials_subsurface",
    "KHR_materials_volume_scatter",
    "MSFT_packing_normalRoughnessMetallic",
    "MSFT_packing_occlusionRoughnessMetallic",
    "VRMC_materials_hdr_emissiveMultiplier",
)
_LISTED = {
    **dict.fromkeys(_NO_EFFECT, GltfExtension(read="nothing", used="nothing")),
    **dict.fromkeys(
        _LAYERS,
        GltfExtension(read="nothing", used="nothing, with a warning", refused=UNKNOWN, ignored=True),
    ),
}


def extension_of(name: str) -> GltfExtension | None:
    """Return how an extension is handled, or None if it is unknown.

    Parameters
    ----------
    name : str
        Name of the extension.

    Returns
    -------
    GltfExtension or None
        Its record.
    """
    return EXTENSIONS.get(name) or _LISTED.get(name)


def known_extensions() -> dict[str, GltfExtension]:
    """Return the records of all known extensions.

    Returns
    -------
    dict of str to GltfExtension
        By name, sorted.
    """
    found = {name: EXTENSIONS.require(name, "extension") for name in EXTENSIONS.names()} | _LISTED
    return {name: found[name] for name in sorted(found)}
