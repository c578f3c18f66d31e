// Colours the ground by material, slope and height, and lights it by the sky.
#import bevy_pbr::{
    forward_io::{FragmentOutput, VertexOutput},
    mesh_view_bindings::view,
    pbr_fragment::pbr_input_from_standard_material,
    pbr_functions::{apply_pbr_lighting, main_pass_post_lighting_processing},
}
#import marchless_examples::noise::{fractal, noise}

struct Ground {
    grass: vec4<f32>,
    dry_grass: vec4<f32>,
    rock: vec4<f32>,
    dark_rock: vec4<f32>,
    sand: vec4<f32>,
    snow: vec4<f32>,
    // rgb: the sky's colour; a: how much light comes from it.
    sky: vec4<f32>,
    mist: vec4<f32>,
    // Lowest ground, highest ground, end of the sand, beginning of the snow.
    heights: vec4<f32>,
}

@group(#{MATERIAL_BIND_GROUP}) @binding(100) var<uniform> ground: Ground;

// Layers of lighter and darker stone, wavy and of different thickness.
fn layers(p: vec3<f32>, large: f32, middle: f32) -> f32 {
    let height = p.y + 7.0 * large + 2.0 * middle;
    let thick = noise(vec3(0.5, height * 0.22, 0.5));
    let thin = noise(vec3(7.5, height * 0.9, 0.5));
    return smoothstep(0.25, 0.75, 0.65 * thick + 0.35 * thin);
}

// 0 at the end of the sand, 1 where the snow begins.
fn height_share(height: f32) -> f32 {
    return (height - ground.heights.z) / max(ground.heights.w - ground.heights.z, 1.0);
}

@fragment
fn fragment(in: VertexOutput, @builtin(front_facing) is_front: bool) -> FragmentOutput {
    var pbr = pbr_input_from_standard_material(in, is_front);
    let p = in.world_position.xyz;
    let distance = length(view.world_position - p);
    let normal = normalize(in.world_normal);

    let large = fractal(p * 0.013, 3);
    let middle = fractal(p * 0.09, 3);
    let fine = fractal(p * 0.9, 2);
    let steep = 1.0 - normal.y;
    let height = p.y + (large - 0.5) * 0.22 * (ground.heights.y - ground.heights.x);

    // Rock, also of the materials that one digs out and builds.
    let stone = mix(ground.dark_rock.rgb, ground.rock.rgb, layers(p, large, middle)) * (0.65 + 0.7 * middle);
    let own = in.color.rgb * mix(0.82, 1.12, layers(p, large, middle)) * (0.8 + 0.4 * middle);

    // Natural ground: meadow with woods, sand below, snow above, rock where it is steep.
    let step = 0.03 * (ground.heights.y - ground.heights.x);
    let rough = 0.10 * (middle - 0.5) + 0.10 * (fine - 0.5);
    var natural = mix(ground.grass.rgb, ground.dry_grass.rgb, smoothstep(0.34, 0.66, 0.75 * large + 0.25 * middle));
    let woods = smoothstep(0.50, 0.60, fractal(p * 0.045 + 31.0, 4)) * smoothstep(0.46, 0.40, height_share(height));
    natural = mix(natural, ground.grass.rgb * (0.30 + 0.35 * fine), 0.85 * woods);
    natural *= 0.86 + 0.28 * middle;
    natural = mix(ground.sand.rgb * (0.9 + 0.2 * fine), natural, smoothstep(-step, step, height - ground.heights.z));
    natural = mix(natural, stone, smoothstep(0.19, 0.32, steep + rough));
    let lies = smoothstep(0.42, 0.30, steep + rough);
    let snow = smoothstep(-step, step, height + (middle - 0.5) * 8.0 - ground.heights.w) * lies;
    natural = mix(natural, ground.snow.rgb, snow);

    var color = mix(natural, own, clamp(in.color.a, 0.0, 1.0));
    color *= 0.76 + 0.48 * fine;

    // Small bumps nearby.
    let close = 1.0 - smoothstep(40.0, 220.0, distance);
    if close > 0.0 {
        let e = 0.35;
        let bumps = vec3(
            fractal((p + vec3(e, 0.0, 0.0)) * 0.9, 2) - fine,
            fractal((p + vec3(0.0, e, 0.0)) * 0.9, 2) - fine,
            fractal((p + vec3(0.0, 0.0, e)) * 0.9, 2) - fine,
        ) / e;
        pbr.N = normalize(pbr.N - close * (1.0 - 0.7 * snow) * 0.38 * (bumps - dot(bumps, pbr.N) * pbr.N));
    }

    pbr.material.base_color = vec4(color, 1.0);
    pbr.material.perceptual_roughness = mix(0.97, 0.7, snow);
    // Light from the sky above, and a little from the ground below.
    let up = 0.5 + 0.5 * pbr.N.y;
    let skylight = mix(ground.rock.rgb * 0.35, ground.sky.rgb, up) * ground.sky.a;
    pbr.material.emissive = vec4(color * skylight, 0.0);

    var out: FragmentOutput;
    var lit = apply_pbr_lighting(pbr);
    // The foot of the terrain stands in mist.
    let depth = (ground.heights.x - p.y) / max(0.35 * (ground.heights.y - ground.heights.x), 1.0);
    lit = vec4(mix(lit.rgb, ground.mist.rgb, smoothstep(0.0, 1.0, depth) * 0.9), lit.a);
    out.color = main_pass_post_lighting_processing(pbr, lit);
    return out;
}
