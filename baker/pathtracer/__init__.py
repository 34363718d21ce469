"""Computes the reference of bakes, and pictures: irradiance, ambient occlusion and radiance by path tracing.

Bakes are verified against this package, so it computes light without the bake's code. The bake and this
package share:

- the scene, resolved materials, textures, alpha and solids;
- the Embree scene and its hit filters;
- random numbers and direction sampling of `kernels.sampling`;
- `lights.emissive_texture.cut`, which divides textured emitters. An error in `cut` would change only sampling
  densities.

This package has its own code for emitters, lights without area, shading, estimators and sums.
"""

from baker.trace.kernel_cache import keep_kernels

keep_kernels(__file__, "baker.trace", "baker.kernels")
