// Shows albedo * E / pi + emission, where E is the irradiance in the page at UV2.
shader_type spatial;
render_mode unshaded;

uniform vec4 albedo : hint_color = vec4(1.0);
uniform sampler2D albedo_texture : hint_albedo;
uniform vec4 emission : hint_color = vec4(0.0, 0.0, 0.0, 1.0);
uniform float emission_energy = 0.0;
uniform sampler2D emission_texture : hint_albedo;
uniform sampler2D page;
uniform vec2 uv_scale = vec2(1.0);
uniform vec2 uv_offset = vec2(0.0);
uniform float exposure = 1.0;

void fragment() {
	vec3 irradiance = texture(page, UV2 * uv_scale + uv_offset).rgb;
	vec3 base = albedo.rgb * texture(albedo_texture, UV).rgb;
	vec3 emitted = emission.rgb * texture(emission_texture, UV).rgb * emission_energy;
	ALBEDO = (base * irradiance / 3.14159265359 + emitted) * exposure;
}
