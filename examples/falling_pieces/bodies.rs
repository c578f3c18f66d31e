//! [`Body`]: an island that hung free. It falls and comes to rest, without a physics engine: bits collide.

use bevy::prelude::*;
use bevy_marchless::bits::prelude::*;
use bevy_marchless::prelude::*;

/// An island that has left the terrain. It falls by whole steps of the lattice as far as collisions go, and smoothly as
/// far as one sees.
#[derive(Component)]
pub(crate) struct Body {
    terrain: Entity,
    bits: BitGrid,
    /// Where its lowest corner was in the terrain's lattice.
    origin: IVec3,
    /// How far it has fallen. [Units: voxels]
    pub(crate) fallen: f32,
    /// [Units: voxels per second]
    speed: f32,
    /// Whether something solid is below it.
    pub(crate) is_at_rest: bool,
    /// [Units: cubic voxels]
    pub(crate) volume: usize,
}

/// [Units: voxels per second²]
const GRAVITY: f32 = 40.0;
/// Smaller islands are dug out, but become no bodies. [Units: cubic voxels]
const DUST: usize = 12;
/// How far around an edit islands are looked for: the whole terrain, since it is small. In a larger one, a snapshot's
/// box would be searched in a task. [Units: voxels]
const MARGIN: u32 = 128;
/// Who falls so far has missed the terrain. [Units: voxels]
const ABYSS: f32 = 300.0;

pub(crate) fn plugin(app: &mut App) {
    // All that an update changes shows in it, so that no island is missing or doubled for a moment.
    app.insert_resource(MarchlessSettings { max_inline_chunks: 64, ..default() })
        .add_systems(Update, (fall, free_pieces).chain());
}

/// Turns what an edit has left without support into bodies: in the same update they appear and are dug out of the
/// terrain.
fn free_pieces(
    mut edits: MessageReader<TerrainEdited>,
    bits: TerrainBits,
    mut stamps: MessageWriter<Stamp>,
    mut commands: Commands,
) {
    for edited in edits.read() {
        let Ok(islands) = bits.loose_islands(edited, MARGIN) else { continue };
        for island in &islands {
            stamps.write_batch(island.stamps(edited.terrain));
            let Ok(samples) = bits.samples(edited.terrain, island) else { continue };
            if island.size() < DUST {
                continue;
            }
            println!("An island of {} cubic voxels hangs free.", island.size());
            let body = Body {
                terrain: edited.terrain,
                bits: island.bits(),
                origin: island.bounds().min.into(),
                fallen: 0.0,
                speed: 0.0,
                is_at_rest: false,
                volume: island.size(),
            };
            // Its samples begin two voxels below its bounds. A voxel is a world unit.
            let place = Transform::from_translation((body.origin - 2).as_vec3());
            commands.spawn((body, samples, place));
        }
    }
}

/// Lets bodies fall as far as nothing is in their way.
fn fall(
    time: Res<Time>,
    bits: TerrainBits,
    mut bodies: Query<(Entity, &mut Body, &mut Transform)>,
    mut commands: Commands,
) {
    let seconds = time.delta_secs().min(0.05);
    let entities: Vec<Entity> = bodies.iter().map(|(entity, ..)| entity).collect();
    for entity in entities {
        let Ok((_, body, _)) = bodies.get(entity) else { continue };
        let speed = body.speed + GRAVITY * seconds;
        let mut fallen = body.fallen + speed * seconds;
        // The lattice place that it occupies, or is about to.
        let mut steps = body.fallen.ceil() as i32;
        let mut is_at_rest = false;
        while fallen > steps as f32 && !is_at_rest {
            let others = bodies.iter().filter(|(other, ..)| *other != entity).map(|(_, other, _)| other);
            is_at_rest = !body.is_free(steps + 1, &bits, others);
            steps += i32::from(!is_at_rest);
        }
        fallen = fallen.min(steps as f32);

        let Ok((_, mut body, mut transform)) = bodies.get_mut(entity) else { continue };
        if is_at_rest && !body.is_at_rest {
            println!("The island of {} cubic voxels is at rest, {steps} voxels below where it was.", body.volume);
        }
        if fallen > ABYSS {
            commands.entity(entity).despawn();
        }
        body.speed = if is_at_rest { 0.0 } else { speed };
        (body.fallen, body.is_at_rest) = (fallen, is_at_rest);
        transform.translation.y = (body.origin.y - 2) as f32 - fallen;
    }
}

impl Body {
    /// Whether nothing solid is where it is after so many steps down.
    fn is_free<'a>(&self, steps: i32, bits: &TerrainBits, mut others: impl Iterator<Item = &'a Self>) -> bool {
        let place = self.origin - steps * IVec3::Y;
        let hits = |other: &Self| {
            let there = other.origin - other.fallen.ceil() as i32 * IVec3::Y;
            other.terrain == self.terrain && other.bits.overlaps(&self.bits, (place - there).to_array())
        };
        // Chunks that are not filled yet carry it, too.
        bits.collides(self.terrain, &self.bits, place) == Ok(false) && !others.any(hits)
    }
}
