//! [`PicturePlugin`]: renders one picture without a window and exits.

use std::error::Error;
use std::io::{Cursor, Write as _};
use std::path::{Path, PathBuf};

use bevy::app::{PluginGroupBuilder, ScheduleRunnerPlugin};
use bevy::camera::RenderTarget;
use bevy::image::{Image, ImageFormat};
use bevy::prelude::*;
use bevy::render::RenderPlugin;
use bevy::render::render_resource::TextureFormat;
use bevy::render::view::screenshot::{Screenshot, ScreenshotCaptured};
use bevy::window::ExitCondition;
use bevy::winit::WinitPlugin;

use crate::files::{check_file, write_atomically};
use crate::indexed;

/// `DefaultPlugins` for a window of that title.
pub fn window_plugins(title: &str) -> PluginGroupBuilder {
    let window = Window { title: title.to_owned(), ..default() };
    DefaultPlugins.set(WindowPlugin { primary_window: Some(window), ..default() })
}

/// `DefaultPlugins` without a window. Shaders are compiled before the frame that needs them, so that no frame lacks
/// anything.
pub fn picture_plugins() -> PluginGroupBuilder {
    DefaultPlugins
        .build()
        .disable::<WinitPlugin>()
        .set(WindowPlugin { primary_window: None, exit_condition: ExitCondition::DontExit, ..default() })
        .set(RenderPlugin { synchronous_pipeline_compilation: true, ..default() })
        .add(ScheduleRunnerPlugin::default())
}

/// Renders what the first 3-D camera sees into a picture file, and exits: with success once it is written, with an
/// error where that fails.
///
/// The picture is taken some frames after [`PictureReady`] becomes true; until then nothing is rendered.
pub struct PicturePlugin {
    /// Where to write it, in the PNG format.
    pub path: PathBuf,
    /// Width and height. [Units: pixels]
    pub size: UVec2,
}

/// Set this to true when the scene is complete.
#[derive(Resource, Default)]
pub struct PictureReady(pub bool);

/// While this is there, the picture's file is small: it has at most 256 colours.
#[derive(Resource)]
pub struct FewColors;

#[derive(Resource)]
struct Picture {
    path: PathBuf,
    target: Handle<Image>,
    frames: u32,
}

/// How many frames are rendered before the one that is taken, so that all buffers and textures have arrived.
const WARM_UP: u32 = 2;

impl Plugin for PicturePlugin {
    fn build(&self, app: &mut App) {
        let target = Image::new_target_texture(self.size.x, self.size.y, TextureFormat::Rgba8UnormSrgb, None);
        let target = app.world_mut().resource_mut::<Assets<Image>>().add(target);
        app.init_resource::<PictureReady>()
            .insert_resource(Picture { path: self.path.clone(), target, frames: 0 })
            .add_observer(aim_camera)
            .add_systems(Last, take_picture.run_if(|ready: Res<PictureReady>| ready.0));
    }
}

fn aim_camera(event: On<Add, Camera3d>, picture: Res<Picture>, mut commands: Commands) {
    let target = RenderTarget::Image(picture.target.clone().into());
    commands.entity(event.entity).insert((target, Camera { is_active: false, ..default() }));
}

fn take_picture(mut commands: Commands, mut picture: ResMut<Picture>, mut cameras: Query<&mut Camera, With<Camera3d>>) {
    for mut camera in &mut cameras {
        camera.is_active = true;
    }
    if picture.frames == WARM_UP {
        commands.spawn(Screenshot::image(picture.target.clone())).observe(save_and_exit);
    }
    picture.frames += 1;
}

fn save_and_exit(
    captured: On<ScreenshotCaptured>,
    picture: Res<Picture>,
    few_colors: Option<Res<FewColors>>,
    mut exit: MessageWriter<AppExit>,
) {
    exit.write(match save(&captured.image, &picture.path, few_colors.is_some()) {
        Ok(()) => {
            println!("Wrote {}.", picture.path.display());
            AppExit::Success
        }
        Err(error) => {
            eprintln!("The picture {} cannot be written: {error}.", picture.path.display());
            AppExit::error()
        }
    });
}

/// Says what is wrong with the name of a picture file, if anything is.
///
/// # Errors
/// A sentence, where the name does not end in .png.
pub fn check_picture_name(path: &Path) -> Result<(), String> {
    if path.extension().is_some_and(|extension| extension.eq_ignore_ascii_case("png")) {
        Ok(())
    } else {
        Err(format!("the picture's name must end in .png, but it is {}", path.display()))
    }
}

/// Says why there can be no picture file of that name, if anything tells.
///
/// # Errors
/// A sentence, where the name does not end in .png, its folder is missing or it is a folder itself.
pub fn check_picture(path: &Path) -> Result<(), String> {
    check_file(path)?;
    check_picture_name(path)
}

/// A picture's width and height, as the command line gives them: `W,H`. [Units: pixels]
///
/// # Errors
/// A sentence, where they are not two whole numbers from 16 to 8192.
pub fn picture_size(text: &str) -> Result<UVec2, String> {
    let sides = text.split_once(',').and_then(|(w, h)| Some((w.trim().parse().ok()?, h.trim().parse().ok()?)));
    let size = sides.map(|(width, height)| UVec2::new(width, height));
    let valid = |size: &UVec2| size.min_element() >= 16 && size.max_element() <= 8192;
    size.filter(valid).ok_or("it must be two whole numbers from 16 to 8192, with a comma between them".to_owned())
}

fn save(image: &Image, path: &Path, few_colors: bool) -> Result<(), Box<dyn Error>> {
    // Without the alpha channel, which means nothing here.
    let image = image.clone().try_into_dynamic()?.to_rgb8();
    let file = if few_colors {
        let pixels: Vec<[u8; 3]> = image.pixels().map(|pixel| pixel.0).collect();
        indexed::encode(image.width(), image.height(), &pixels)?
    } else {
        let format = ImageFormat::Png.as_image_crate_format().ok_or("PNG is not supported")?;
        let mut file = Cursor::new(Vec::new());
        image.write_to(&mut file, format)?;
        file.into_inner()
    };
    write_atomically(path, |out| out.write_all(&file))?;
    Ok(())
}
