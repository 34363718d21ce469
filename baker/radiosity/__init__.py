"""Light transport between texels: direct light, patches, form factors, solve, final gather."""
