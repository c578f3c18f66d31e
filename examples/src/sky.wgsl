// A sky with a sun, haze round it and clouds, by the direction one looks in.
#import bevy_pbr::{forward_io::VertexOutput, mesh_view_bindings::view}
#import marchless_examples::noise::fractal
#ifdef TONEMAP_IN_SHADER
#import bevy_core_pipeline::tonemapping::tone_mapping
#endif

struct Sky {
    zenith: vec4<f32>,
    horizon: vec4<f32>,
    // rgb: the sun's colour; a: the share of clouds.
    sun: vec4<f32>,
    to_sun: vec4<f32>,
}

@group(#{MATERIAL_BIND_GROUP}) @binding(0) var<uniform> sky: Sky;

@fragment
fn fragment(in: VertexOutput) -> @location(0) vec4<f32> {
    let direction = normalize(in.world_position.xyz - view.world_position);
    let up = direction.y;
    let towards_sun = max(dot(direction, sky.to_sun.xyz), 0.0);

    var color = mix(sky.zenith.rgb, sky.horizon.rgb, exp(-4.5 * max(up, 0.0)));
    // Haze glows round the sun, most where it is thick.
    let haze = exp(-6.0 * max(up, 0.0));
    color += sky.sun.rgb * (0.20 * pow(towards_sun, 6.0) * haze + 0.16 * pow(towards_sun, 48.0));

    if up > 0.015 && sky.sun.a > 0.0 {
        // A layer of clouds overhead, seen in perspective.
        let p = direction.xz / (up + 0.12);
        let shape = fractal(vec3(p * 1.1, 3.7), 5);
        let towards = sky.to_sun.xz * 0.12;
        let lit = clamp(0.5 + 3.0 * (shape - fractal(vec3((p + towards) * 1.1, 3.7), 4)), 0.0, 1.0);
        let edge = 0.62 - 0.24 * sky.sun.a;
        let cover = smoothstep(edge, edge + 0.2, shape) * smoothstep(0.015, 0.14, up);
        let shade = mix(sky.horizon.rgb * 0.72, vec3(0.25) + sky.sun.rgb * 0.85, lit);
        color = mix(color, shade, cover * 0.85);
    }
    if up < 0.0 {
        // A sea of mist below.
        let p = direction.xz / (0.10 - up);
        let waves = fractal(vec3(p * 1.3, 9.1), 4);
        let lit = mix(sky.horizon.rgb * 0.86, vec3(0.12) + sky.horizon.rgb * 0.95, smoothstep(0.30, 0.70, waves));
        color = mix(color, lit, smoothstep(0.0, 0.18, -up) * 0.8);
    }
    color += sky.sun.rgb * 14.0 * smoothstep(0.99955, 0.99975, towards_sun);

    var out = vec4(color, 1.0);
#ifdef TONEMAP_IN_SHADER
    out = tone_mapping(out, view.color_grading);
#endif
    return out;
}
