// Value noise from integer hashes: the same on every machine, without textures.
#define_import_path marchless_examples::noise

fn hash(p: vec3<i32>) -> f32 {
    var h = u32(p.x) * 0x8da6b343u ^ u32(p.y) * 0xd8163841u ^ u32(p.z) * 0xcb1ab31fu;
    h = (h ^ (h >> 15u)) * 0x2c1b3c6du;
    h = (h ^ (h >> 12u)) * 0x297a2d39u;
    return f32((h ^ (h >> 15u)) >> 8u) / 16777216.0;
}

// Smooth noise between 0 and 1, features of size 1.
fn noise(p: vec3<f32>) -> f32 {
    let cell = vec3<i32>(floor(p));
    let f = fract(p);
    let t = f * f * (3.0 - 2.0 * f);
    let x00 = mix(hash(cell), hash(cell + vec3(1, 0, 0)), t.x);
    let x10 = mix(hash(cell + vec3(0, 1, 0)), hash(cell + vec3(1, 1, 0)), t.x);
    let x01 = mix(hash(cell + vec3(0, 0, 1)), hash(cell + vec3(1, 0, 1)), t.x);
    let x11 = mix(hash(cell + vec3(0, 1, 1)), hash(cell + vec3(1, 1, 1)), t.x);
    return mix(mix(x00, x10, t.y), mix(x01, x11, t.y), t.z);
}

// The sum of octaves of noise, between 0 and 1.
fn fractal(p: vec3<f32>, octaves: i32) -> f32 {
    var q = p;
    var sum = 0.0;
    var total = 0.0;
    var weight = 0.5;
    for (var i = 0; i < octaves; i++) {
        sum += weight * noise(q);
        total += weight;
        weight *= 0.5;
        // Turned and more than doubled, so that the octaves' lattices never meet.
        q = vec3(0.8 * q.x + 0.6 * q.z, q.y, 0.8 * q.z - 0.6 * q.x) * 2.03 + 17.3;
    }
    return sum / total;
}
