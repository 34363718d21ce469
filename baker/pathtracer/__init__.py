"""The reference: irradiance, ambient occlusion and pictures by path tracing.

A bake is verified against this package, so it computes light without the bake's code. Both read the same
scene, resolved materials, textures, alpha and solids, cast rays with the same tree and filters, and take
random numbers and directions from `kernels.sampling`; both divide emissive textures with
`lights.emissive_texture.cut`, which determines sampling densities only. Emitters, lights without area,
shading, estimators and sums are this package's own.
"""

from baker.trace.kernel_cache import keep_kernels

keep_kernels(__file__, "baker.trace", "baker.kernels")
