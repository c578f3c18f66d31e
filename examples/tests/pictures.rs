//! Pictures of the examples, rendered for real: coarse features are compared, not exact pixels.
//!
//! Without a graphics adapter the tests skip with a printed line; with `MARCHLESS_REQUIRE_PICTURES=1` they fail
//! instead. Pictures are kept in `MARCHLESS_PICTURES`, by default in the folder of tests in `target`. The height map is
//! that of `MARCHLESS_TEST_DATA`, or a generated one.

mod common;

use std::collections::HashSet;
use std::fs::{self, File};
use std::io::{BufReader, BufWriter};
use std::path::{Path, PathBuf};
use std::process::{Child, Command, Stdio};
use std::time::{Duration, Instant};

use common::{example, folder_of_tests};

/// Rows of red, green and blue.
struct Picture {
    width: usize,
    pixels: Vec<[u8; 3]>,
}

/// A ball that was dug, as the picture shows it. [Units: pixels]
struct Disc {
    x: f32,
    y: f32,
    radius: f32,
}

const SIZE: &str = "320,180";

#[test]
fn a_dig_shows_where_it_was_dug_and_nowhere_else() {
    let Some((before, _)) = sculpt("hills", &[]) else { return };
    let Some((after, discs)) = sculpt("hills_dug", &["--dig", "0.45,0.62,16"]) else { return };
    before.assert_is_a_landscape();
    after.assert_is_a_landscape();
    assert_only_disc_changed(&before, &after, &discs);
}

#[test]
fn a_height_map_can_be_dug() {
    let map = height_map();
    let map = map.to_str().expect("the folder of tests has a plain name");
    let flags = ["--heightmap", map, "--metres-per-pixel", "74,93", "--metres-per-unit", "1", "--exaggerate", "3"];
    // Fewer voxels than by default: this is about the picture.
    let flags = [flags.as_slice(), &["--voxel-size", "120"]].concat();
    let Some((before, _)) = sculpt("height_map", &flags) else { return };
    let Some((after, discs)) = sculpt("height_map_dug", &[&flags[..], &["--dig", "0.4,0.8,14"]].concat()) else {
        return;
    };
    before.assert_is_a_landscape();
    assert_only_disc_changed(&before, &after, &discs);
}

#[test]
fn quickstart_shows_hills() {
    let path = picture_path("quickstart");
    let Some(_) = render(example("quickstart").arg("--screenshot").arg(&path)) else { return };
    Picture::read(&path).assert_is_a_landscape();
}

#[test]
fn sharp_terrain_shows_a_hut_on_earth_three_times() {
    let path = picture_path("sharp_terrain");
    let Some(_) = render(example("sharp_terrain").arg("--screenshot").arg(&path)) else { return };
    let picture = Picture::read(&path);
    let third = picture.width / 3;
    for view in 0..3 {
        let (mut stone, mut earth) = (0, 0);
        for row in picture.pixels.chunks(picture.width) {
            for [red, green, blue] in &row[view * third..(view + 1) * third] {
                let is_grey = red.max(green).max(blue) - red.min(green).min(blue) < 16;
                stone += usize::from(is_grey);
                earth += usize::from(!is_grey && green > red && green > blue);
            }
        }
        assert!(stone > 2_000 && earth > 8_000, "view {view}: {stone} pixels of stone, {earth} of earth");
    }
}

#[test]
fn ten_million_voxels_away_everything_looks_the_same() {
    let picture = |name: &str, voxels: &str| {
        let path = picture_path(name);
        render(example("far_away").args(["--voxels", voxels]).arg("--screenshot").arg(&path))?;
        Some(Picture::read(&path))
    };
    let Some(near) = picture("far_away_0", "0") else { return };
    near.assert_is_a_landscape();
    // At a thousand million not even chunks' corners are single-precision numbers.
    for voxels in ["10000000", "1000000000"] {
        let Some(far) = picture(&format!("far_away_{voxels}"), voxels) else { return };
        let differing = near.pixels.iter().zip(&far.pixels).filter(|(a, b)| a != b).count();
        assert_eq!((near.pixels.len(), differing), (far.pixels.len(), 0), "pixels that differ at {voxels}");
    }
}

#[test]
fn what_hangs_free_falls_and_comes_to_rest() {
    let picture = |moment: &str| {
        let path = picture_path(&format!("falling_pieces_{moment}"));
        let mut command = example("falling_pieces");
        render(command.args(["--size", SIZE, "--moment", moment]).arg("--screenshot").arg(&path))?;
        Some(Picture::read(&path))
    };
    let moments = ["before", "falling", "rest"].map(picture);
    let [Some(before), Some(falling), Some(rest)] = moments else { return };
    // The mushroom's cap is all that is red. It moves down, and looks the same.
    let caps = [&before, &falling, &rest].map(|picture| {
        picture.assert_is_a_landscape();
        let is_red = |[red, green, _]: [u8; 3]| u32::from(red) * 10 > u32::from(green) * 14 && red > 60;
        let rows = picture.pixels.iter().enumerate().filter(|(_, pixel)| is_red(**pixel));
        let rows: Vec<_> = rows.map(|(index, _)| (index / picture.width) as f64).collect();
        (rows.len() as f64, rows.iter().sum::<f64>() / rows.len().max(1) as f64)
    });
    let [(size, start), (_, middle), (_, end)] = caps;
    assert!(size > 1_000.0 && caps.iter().all(|(other, _)| (other / size - 1.0).abs() < 0.2), "{caps:?}");
    assert!(start + 5.0 < middle && middle + 5.0 < end && end < start + 60.0, "{caps:?}");
}

#[test]
fn cells_that_are_not_ambiguous_look_alike_in_both_topologies() {
    // A single corner.
    let Some(picture) = cell("cell_single_corner", "0.8,1,0.5,0.8,0.5,0.8,-0.6,0.5") else { return };
    let [separated, trilinear, _] = picture.cubes();
    let differing = share_of_differing(&separated, &trilinear);
    assert!(differing < 0.04, "{:.1} % differ", 100.0 * differing);
}

#[test]
fn cells_with_a_tunnel_look_different_in_both_topologies() {
    let Some(picture) = cell("cell_tunnel", "-1,0.1,0.3,0.3,0.3,0.1,0.1,-1") else { return };
    let [separated, trilinear, refined] = picture.cubes();
    let differing = share_of_differing(&separated, &trilinear);
    assert!(differing > 0.1, "only {:.1} % differ", 100.0 * differing);
    let [wrong, right] = [&separated, &trilinear].map(|cube| share_of_differing(cube, &refined));
    assert!(right < wrong, "the interpolant differs by {:.1} and {:.1} %", 100.0 * wrong, 100.0 * right);
}

#[test]
fn a_block_cut_open_shows_caves() {
    // Caves' walls are yellow above, red in the middle, blue below; without caves there is nothing but rock.
    let colors = |name: &str, flags: &[&str]| {
        let path = picture_path(name);
        let flags = [&["--size", SIZE, "--edge", "48"], flags].concat();
        render(example("cellular_caves").args(flags).arg("--screenshot").arg(&path))?;
        let picture = Picture::read(&path);
        let share = |matches: fn([u8; 3]) -> bool| {
            picture.pixels.iter().filter(|&&pixel| matches(pixel)).count() as f64 / picture.pixels.len() as f64
        };
        let rock = share(|[red, green, blue]| red > 60 && red > green && green > blue);
        // More blue than green: in no rock, in all walls below the upper third. The background is darker.
        let walls = share(|[red, green, blue]| red > 45 && blue > green.saturating_add(8));
        Some((rock, walls))
    };
    let Some((rock, walls)) = colors("caves", &[]) else { return };
    assert!(rock > 0.2 && walls > 0.008, "rock is {:.1} %, walls are {:.1} %", 100.0 * rock, 100.0 * walls);
    let Some((rock, walls)) = colors("caves_none", &["--fill", "1"]) else { return };
    assert!(rock > 0.25 && walls < 0.001, "rock is {:.1} %, walls are {:.1} %", 100.0 * rock, 100.0 * walls);
    let Some((_, bodies)) = colors("caves_bodies", &["--caves"]) else { return };
    assert!(bodies > 0.025, "bodies are {:.1} %", 100.0 * bodies);
}

#[test]
fn an_endless_world_ends_in_haze_and_keeps_what_was_dug() {
    let Some((arrived, _)) = flyover("flyover_arrived", "arrived") else { return };
    arrived.assert_is_a_landscape();
    // Hills stand out below; where the range ends, a little below the horizon, nothing but haze is left.
    let [hills, haze] = [(0.75, 1.0), (0.36, 0.44)].map(|rows| arrived.roughness(rows));
    assert!(hills > 4.0 * haze, "neighbouring pixels differ by {hills:.2} in the hills, by {haze:.2} in the haze");

    let Some((dug, discs)) = flyover("flyover_dug", "dug") else { return };
    assert_only_disc_changed(&arrived, &dug, &discs);
    let Some((back, _)) = flyover("flyover_back", "back") else { return };
    let differing = dug.pixels.iter().zip(&back.pixels).filter(|(a, b)| a != b).count();
    assert_eq!(differing, 0, "of {} pixels so many differ after coming back", dug.pixels.len());
}

#[test]
fn triangles_show_levels_that_get_coarser_with_distance() {
    let path = picture_path("flyover_triangles");
    let flags = ["--size", SIZE, "--radius", "513", "--triangles"];
    let Some(_) = render(example("flyover").args(flags).arg("--screenshot").arg(&path)) else { return };
    let picture = Picture::read(&path);
    // Level 0 is red, level 1 orange, level 2 yellow. Sky and snow have more blue, meadows and rock less red.
    let shares = [(0.0, 0.45), (0.5, 0.8), (0.85, 1.1)].map(|(least, most)| {
        let pixels = picture.pixels.iter().enumerate().filter(|(_, pixel)| {
            let [red, green, blue] = pixel.map(f64::from);
            red > 180.0 && blue < 0.45 * red && (least * red..most * red).contains(&green)
        });
        let rows: Vec<_> = pixels.map(|(index, _)| (index / picture.width) as f64).collect();
        (rows.len() as f64 / picture.pixels.len() as f64, rows.iter().sum::<f64>() / rows.len().max(1) as f64)
    });
    assert!(shares.iter().all(|(share, _)| *share > 0.02), "shares and mean rows: {shares:.3?}");
    assert!(shares.is_sorted_by(|a, b| a.1 > b.1 + 10.0), "shares and mean rows: {shares:.3?}");
}

#[test]
fn ground_at_coarse_levels_looks_like_ground_at_the_finest() {
    // One sees 512 voxels far at one level, 513 at several: the finest, and two coarser ones behind it.
    let [one, several] = ["512", "513"].map(|radius| {
        let path = picture_path(&format!("flyover_{radius}"));
        let flags = ["--size", SIZE, "--radius", radius];
        render(example("flyover").args(flags).arg("--screenshot").arg(&path))?;
        Some(Picture::read(&path))
    });
    let [Some(one), Some(several)] = [one, several] else { return };
    one.assert_is_a_landscape();
    // Where sky shone through the ground, or a splinter stood out, a pixel would differ.
    let pairs = one.pixels.iter().zip(&several.pixels);
    let differing = pairs.filter(|(a, b)| (0..3).any(|channel| a[channel].abs_diff(b[channel]) > 32)).count();
    let share = differing as f64 / one.pixels.len() as f64;
    assert!(share < 0.005, "{:.2} % of the pixels differ", 100.0 * share);
    // Where materials or light were other ones, a whole patch would be of another colour.
    let patches = [&one, &several].map(|picture| picture.patches(16, 12));
    let differences = patches[0].iter().zip(&patches[1]).flat_map(|(a, b)| (0..3).map(|c| (a[c] - b[c]).abs()));
    let greatest = differences.fold(0.0, f64::max);
    assert!(greatest < 10.0, "patches differ by up to {greatest:.1} of 255");
}

#[test]
fn a_window_opens_and_shows_something() {
    let folder = folder_of_tests().join(format!("screen_{}", std::process::id()));
    fs::create_dir_all(&folder).expect("the folder of tests can be written");
    let mut screen = Command::new("Xvfb");
    // The server chooses a free display and writes its number to standard output.
    screen.args(["-displayfd", "1", "-screen", "0", "640x360x24", "-nolisten", "tcp", "-fbdir"]).arg(&folder);
    let Ok(screen) = screen.stdout(Stdio::piped()).stderr(Stdio::null()).spawn() else {
        return skip("there is no Xvfb");
    };
    let mut screen = Running(screen);
    let mut display = String::new();
    let stdout = screen.0.stdout.take().expect("it is piped");
    std::io::BufRead::read_line(&mut BufReader::new(stdout), &mut display).expect("Xvfb names its display");

    let log = File::create(folder.join("log.txt")).expect("the folder of tests can be written");
    let mut sculpt = example("sculpt");
    sculpt.env("DISPLAY", format!(":{}", display.trim())).env_remove("WAYLAND_DISPLAY");
    sculpt.args(["--out", "window.glb"]).stdout(log.try_clone().expect("a log")).stderr(log);
    let mut sculpt = Running(sculpt.spawn().expect("sculpt can be run"));

    let start = Instant::now();
    loop {
        std::thread::sleep(Duration::from_millis(500));
        let said = || fs::read_to_string(folder.join("log.txt")).unwrap_or_default();
        if let Some(status) = sculpt.0.try_wait().expect("a child can be waited for") {
            let said = said();
            if said.contains("there is no graphics adapter") {
                return skip("there is no graphics adapter");
            }
            panic!("sculpt has ended with {status}:\n{said}");
        }
        let colors = fs::read(folder.join("Xvfb_screen0")).map_or(0, |dump| colors_of_dump(&dump));
        if colors > 1000 {
            break;
        }
        assert!(start.elapsed() < Duration::from_secs(300), "after 5 minutes {colors} colours:\n{}", said());
    }
}

/// A process that ends with the test.
struct Running(Child);

impl Drop for Running {
    fn drop(&mut self) {
        // It may have ended by itself.
        let _ = self.0.kill();
        let _ = self.0.wait();
    }
}

/// How many different colours a window dump (XWD, 32 bits a pixel) has.
fn colors_of_dump(dump: &[u8]) -> usize {
    let word =
        |index: usize| dump.get(4 * index..4 * index + 4).map_or(0, |b| u32::from_be_bytes([b[0], b[1], b[2], b[3]]));
    // The header's size, and the colour map's entries of 12 bytes.
    let pixels = word(0) as usize + 12 * word(19) as usize;
    dump.get(pixels..).unwrap_or_default().chunks_exact(4).collect::<HashSet<_>>().len()
}

fn skip(reason: &str) {
    assert!(std::env::var_os("MARCHLESS_REQUIRE_PICTURES").is_none_or(|v| v != "1"), "no picture, since {reason}");
    println!("Skipped: {reason}.");
}

/// Runs `command`, which renders a picture, and returns what it says; nothing where the test must be skipped.
fn render(command: &mut Command) -> Option<String> {
    let output = command.output().expect("the example can be run");
    let errors = String::from_utf8_lossy(&output.stderr);
    if errors.contains("there is no graphics adapter") {
        skip("there is no graphics adapter");
        return None;
    }
    assert!(output.status.success(), "{command:?} has ended with {}:\n{errors}", output.status);
    Some(String::from_utf8_lossy(&output.stdout).into_owned())
}

fn sculpt(name: &str, flags: &[&str]) -> Option<(Picture, Vec<Disc>)> {
    let path = picture_path(name);
    let said = render(example("sculpt").args(["--size", SIZE]).args(flags).arg("--screenshot").arg(&path))?;
    Some((Picture::read(&path), said.lines().filter_map(Disc::parse).collect()))
}

/// What one sees from a hill of the endless world. Where one went away, what was dug had been unloaded.
fn flyover(name: &str, moment: &str) -> Option<(Picture, Vec<Disc>)> {
    let path = picture_path(name);
    let flags = ["--size", SIZE, "--radius", "192", "--moment", moment];
    let said = render(example("flyover").args(flags).arg("--screenshot").arg(&path))?;
    assert!(!said.contains("still loaded") && said.contains("the hole is unloaded") == (moment == "back"), "{said}");
    Some((Picture::read(&path), said.lines().filter_map(Disc::parse).collect()))
}

/// A picture of one cell, in which every cube shows something.
fn cell(name: &str, weights: &str) -> Option<Picture> {
    let path = picture_path(name);
    render(
        example("ambiguous_cells").args(["--size", "480,210", "--weights", weights]).arg("--screenshot").arg(&path),
    )?;
    let picture = Picture::read(&path);
    for cube in picture.cubes() {
        // Corners and surface: inside is orange, outside blue.
        let count = |matches: fn([u8; 3]) -> bool| cube.iter().filter(|&&pixel| matches(pixel)).count();
        let orange = count(|[red, _, blue]| red > 120 && red > blue.saturating_add(50));
        let blue = count(|[red, _, blue]| blue > 120 && blue > red.saturating_add(50));
        assert!(orange > 50 && blue > 50, "of {} pixels {orange} are orange and {blue} blue", cube.len());
    }
    Some(picture)
}

/// How many of two cubes' pixels differ clearly.
fn share_of_differing(a: &[[u8; 3]], b: &[[u8; 3]]) -> f64 {
    let differ = |(a, b): &(&[u8; 3], &[u8; 3])| a.iter().zip(*b).any(|(a, b)| a.abs_diff(*b) > 48);
    a.iter().zip(b).filter(differ).count() as f64 / a.len().max(1) as f64
}

fn picture_path(name: &str) -> PathBuf {
    let folder = std::env::var_os("MARCHLESS_PICTURES").map_or_else(folder_of_tests, PathBuf::from);
    fs::create_dir_all(&folder).expect("the folder of pictures can be made");
    fs::canonicalize(folder).expect("it is there").join(format!("{name}.png"))
}

fn height_map() -> PathBuf {
    if let Some(data) = std::env::var_os("MARCHLESS_TEST_DATA") {
        let path = PathBuf::from(data).join("jacksboro_dem.png");
        if path.exists() {
            return path;
        }
    }
    println!("A generated height map, since MARCHLESS_TEST_DATA names no folder with jacksboro_dem.png.");
    let path = folder_of_tests().join("generated_dem.png");
    let (width, height) = (400u32, 340u32);
    let samples = (0..width * height).flat_map(|index| {
        let [x, z] = [index % width, index / width].map(|v| v as f32 / 60.0);
        let elevation = 600.0 + 260.0 * x.sin() * (0.8 * z).cos() + 90.0 * (2.7 * x + 1.9 * z).sin();
        (elevation as u16).to_be_bytes()
    });
    let file = BufWriter::new(File::create(&path).expect("the folder of tests can be written"));
    let mut encoder = png::Encoder::new(file, width, height);
    encoder.set_color(png::ColorType::Grayscale);
    encoder.set_depth(png::BitDepth::Sixteen);
    let mut writer = encoder.write_header().expect("a header");
    writer.write_image_data(&samples.collect::<Vec<u8>>()).expect("as many samples as the header says");
    path
}

/// Of the disc at least 30 % of the pixels change, elsewhere at most 1 %.
fn assert_only_disc_changed(before: &Picture, after: &Picture, discs: &[Disc]) {
    let [disc] = discs else { panic!("{} balls were dug", discs.len()) };
    assert!(disc.radius > 4.0, "a ball of {} pixels is too small to see", disc.radius);
    let mut counts = [[0u32; 2]; 2];
    for (index, (a, b)) in before.pixels.iter().zip(&after.pixels).enumerate() {
        let [dx, dy] = [(index % before.width) as f32 + 0.5 - disc.x, (index / before.width) as f32 + 0.5 - disc.y];
        let distance = dx.hypot(dy);
        // The crater's rim is soft.
        if distance > disc.radius && distance < disc.radius + 3.0 {
            continue;
        }
        let changed = (0..3).any(|channel| a[channel].abs_diff(b[channel]) > 8);
        counts[usize::from(distance <= disc.radius)][usize::from(changed)] += 1;
    }
    let share = |[same, changed]: [u32; 2]| f64::from(changed) / f64::from((same + changed).max(1));
    let [outside, inside] = counts.map(share);
    assert!(inside >= 0.30, "of the disc only {:.1} % have changed", 100.0 * inside);
    assert!(outside <= 0.01, "elsewhere {:.2} % have changed", 100.0 * outside);
}

impl Disc {
    /// From a line such as `Dug a ball at 160,90 of 24 pixels radius.`
    fn parse(line: &str) -> Option<Self> {
        let (place, radius) = line.strip_prefix("Dug a ball at ")?.split_once(" of ")?;
        let (x, y) = place.split_once(',')?;
        let radius = radius.strip_suffix(" pixels radius.")?;
        Some(Self { x: x.parse().ok()?, y: y.parse().ok()?, radius: radius.parse().ok()? })
    }
}

impl Picture {
    fn read(path: &Path) -> Self {
        let file = BufReader::new(File::open(path).expect("the picture was written"));
        let mut decoder = png::Decoder::new(file);
        decoder.set_transformations(png::Transformations::EXPAND);
        let mut reader = decoder.read_info().expect("it is a PNG picture");
        let mut bytes = vec![0; reader.output_buffer_size().expect("it is small")];
        let info = reader.next_frame(&mut bytes).expect("it is whole");
        assert_eq!((info.color_type, info.bit_depth), (png::ColorType::Rgb, png::BitDepth::Eight));
        let pixels = bytes[..info.buffer_size()].chunks_exact(3).map(|p| [p[0], p[1], p[2]]).collect();
        Self { width: info.width as usize, pixels }
    }

    /// The three cubes of `ambiguous_cells`, without the titles above and the figures below them.
    fn cubes(&self) -> [Vec<[u8; 3]>; 3] {
        let rows = self.pixels.len() / self.width;
        [0, 1, 2].map(|cube| {
            let columns = cube * self.width / 3..(cube + 1) * self.width / 3;
            let inner = self.pixels.chunks_exact(self.width).take(rows * 4 / 5).skip(rows / 8);
            inner.flat_map(|row| row[columns.clone()].iter().copied()).collect()
        })
    }

    /// The mean colours of patches of this width and height, in pixels.
    fn patches(&self, width: usize, height: usize) -> Vec<[f64; 3]> {
        let mut sums = vec![[0.0; 3]; self.width / width * (self.pixels.len() / self.width / height)];
        for (index, pixel) in self.pixels.iter().enumerate() {
            let patch = index % self.width / width + index / self.width / height * (self.width / width);
            for (sum, value) in sums[patch].iter_mut().zip(pixel) {
                *sum += f64::from(*value) / (width * height) as f64;
            }
        }
        sums
    }

    /// How much pixels differ from those below them, in rows given as shares of the height. [Units: levels of 255]
    fn roughness(&self, (from, to): (f64, f64)) -> f64 {
        let rows: Vec<&[[u8; 3]]> = self.pixels.chunks_exact(self.width).collect();
        let row = |share: f64| (share * rows.len() as f64) as usize;
        let rows = &rows[row(from)..row(to)];
        let differences = rows.windows(2).flat_map(|pair| pair[0].iter().zip(pair[1]));
        let sum: f64 = differences.map(|(a, b)| f64::from(a[1].abs_diff(b[1]))).sum();
        sum / ((rows.len() - 1) * self.width) as f64
    }

    /// Neither black nor uniform: sky above, something else below, and many colours.
    fn assert_is_a_landscape(&self) {
        let mean = |pixels: &[[u8; 3]]| {
            let sum = |channel: usize| pixels.iter().map(|pixel| f64::from(pixel[channel])).sum::<f64>();
            [0, 1, 2].map(|channel| sum(channel) / pixels.len() as f64)
        };
        let tenth = self.pixels.len() / 10;
        let [above, middle] = [mean(&self.pixels[..tenth]), mean(&self.pixels[5 * tenth..7 * tenth])];
        let difference: f64 = (0..3).map(|channel| (above[channel] - middle[channel]).abs()).sum();
        let colors = self.pixels.iter().collect::<HashSet<_>>().len();
        assert!(above.iter().sum::<f64>() > 90.0, "the sky is black: {above:.0?}");
        assert!(middle.iter().sum::<f64>() > 45.0, "the ground is black: {middle:.0?}");
        assert!(difference > 30.0, "ground and sky are alike: {middle:.0?} and {above:.0?}");
        assert!(colors > 200, "there are only {colors} colours");
    }
}
