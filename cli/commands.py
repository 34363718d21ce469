"""Lists the names and summaries of the subcommands, in the order of the help."""

from __future__ import annotations

# Summary of each subcommand by its name. The module with this name in this package defines the subcommand.
COMMANDS = {
    "bake": "Bake a scene: unwrap, trace, solve, write lightmaps and scene.glb.",
    "ao": "Bake ambient occlusion only.",
    "check": "Find defects of scenes before they are baked.",
    "batch": "Bake many scenes, but only those that changed.",
    "verify": "Measure the error of a bake against path tracing.",
    "diff": "Compare two bakes at the same surface points.",
    "render": "Path-trace a scene through a camera.",
    "view": "Show a bake in a local web page.",
    "inspect": "Print the contents of a scene, a bake or a lightmap image.",
}
