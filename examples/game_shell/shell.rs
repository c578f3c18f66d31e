//! Menu and level, pause and slow motion.

use bevy::ecs::entity_disabling::Disabled;
use bevy::input::common_conditions::input_just_pressed;
use bevy::prelude::*;
use bevy_marchless::prelude::*;

/// What one is doing.
#[derive(States, Clone, Copy, Debug, Default, PartialEq, Eq, Hash)]
pub(crate) enum Screen {
    #[default]
    Menu,
    /// Everything in it has a `DespawnOnExit`.
    Level,
}

/// Whether the level goes on.
#[derive(SubStates, Clone, Copy, Debug, Default, PartialEq, Eq, Hash)]
#[source(Screen = Screen::Level)]
pub(crate) enum Pace {
    #[default]
    Running,
    Paused,
}

/// How fast slow motion is.
const SLOW: f32 = 0.25;

pub(crate) fn plugin(app: &mut App) {
    app.init_state::<Screen>()
        .add_sub_state::<Pace>()
        .add_systems(OnEnter(Pace::Paused), halt)
        .add_systems(OnExit(Pace::Paused), go_on)
        .add_systems(
            Update,
            (
                start.run_if(in_state(Screen::Menu)).run_if(input_just_pressed(KeyCode::Enter)),
                leave.run_if(in_state(Screen::Level)).run_if(input_just_pressed(KeyCode::Backspace)),
                pause.run_if(input_just_pressed(KeyCode::KeyP)),
                slow_down.run_if(input_just_pressed(KeyCode::KeyT)),
            ),
        );
}

fn start(mut next: ResMut<NextState<Screen>>) {
    next.set(Screen::Level);
}

fn leave(mut next: ResMut<NextState<Screen>>) {
    next.set(Screen::Menu);
}

fn pause(pace: Option<Res<State<Pace>>>, mut next: ResMut<NextState<Pace>>) {
    match pace.as_deref().map(State::get) {
        Some(Pace::Running) => next.set(Pace::Paused),
        Some(Pace::Paused) => next.set(Pace::Running),
        None => {}
    }
}

/// Time and terrains stand still. Chunks stay drawn, stamps are still read, and wait until the game goes on.
fn halt(mut time: ResMut<Time<Virtual>>, terrains: Query<Entity, With<Terrain>>, mut commands: Commands) {
    time.pause();
    terrains.iter().for_each(|terrain| _ = commands.entity(terrain).try_insert(Disabled));
}

fn go_on(
    mut time: ResMut<Time<Virtual>>,
    terrains: Query<Entity, (With<Terrain>, With<Disabled>)>,
    mut commands: Commands,
) {
    time.unpause();
    terrains.iter().for_each(|terrain| _ = commands.entity(terrain).try_remove::<Disabled>());
}

fn slow_down(mut time: ResMut<Time<Virtual>>) {
    let speed = if time.relative_speed() < 1.0 { 1.0 } else { SLOW };
    time.set_relative_speed(speed);
}
