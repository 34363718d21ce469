// Shows albedo * page + emission, where the page holds E / pi * exposure at UV2. The texture has `slices`
// pages, one below the other. lightmaps.gd replaces the render mode cull_back and the line of ALPHA by those
// of the material.
shader_type spatial;
render_mode unshaded, cull_back;

uniform vec4 albedo : hint_color = vec4(1.0);
uniform sampler2D albedo_texture : hint_albedo;
uniform bool vertex_colour = false;
uniform vec4 emission : hint_color = vec4(0.0, 0.0, 0.0, 1.0);
uniform float emission_energy = 0.0;
uniform sampler2D emission_texture : hint_albedo;
uniform vec2 uv1_scale = vec2(1.0);
uniform vec2 uv1_offset = vec2(0.0);
uniform float alpha_scissor = 0.5;
uniform sampler2D pages;
uniform float slice = 0.0;
uniform float slices = 1.0;
uniform float page_size = 1.0;
uniform vec2 uv_scale = vec2(1.0);
uniform vec2 uv_offset = vec2(0.0);
uniform float exposure = 1.0;

void fragment() {
	vec2 uv = UV * uv1_scale + uv1_offset;
	vec4 base = albedo * texture(albedo_texture, uv);
	if (vertex_colour) {
		base *= COLOR;
	}
	vec2 page_uv = UV2 * uv_scale + uv_offset;
	// The clamp keeps bilinear lookups out of the neighbouring pages.
	float v = (clamp(page_uv.y, 0.5 / page_size, 1.0 - 0.5 / page_size) + slice) / slices;
	vec3 light = texture(pages, vec2(page_uv.x, v)).rgb;
	vec3 emitted = emission.rgb * texture(emission_texture, uv).rgb * emission_energy;
	ALBEDO = (base.rgb * light + emitted) * exposure;
	// ALPHA
}
