//! Many chunks on two threads, compared with one thread and two independent processes.
//!
//! A worker has its own chunks, mesher and buffer, and meshes all of its chunks several times. The three ways take
//! turns, so that other work of the machine affects them alike. The time of two workers is that of the slower one.

use core::fmt;
use std::{
    env,
    io::{self, BufRead, BufReader, Write},
    process::{Child, ChildStdin, ChildStdout, Command, Stdio},
    sync::Barrier,
    thread,
    time::Instant,
};

use marchless::{MeshBuffer, MeshSettings, Mesher, Samples, Shape, Weight};
use marchless_benches::{Field, duration};

use crate::results::median;

/// The environment variable that makes this program a worker; its value is the number of chunks per axis.
pub(crate) const WORKER: &str = "MARCHLESS_BENCH_WORKER";
/// Samples and cells of a chunk per axis.
const SAMPLES: usize = 35;
const CELLS: usize = 32;
/// The number of times that a worker meshes its chunks in one round.
const PASSES: usize = 10;

/// The times of the three ways, per worker.
pub(crate) struct Threads {
    chunks: usize,
    /// Seconds for all passes over all chunks: medians of all rounds.
    one_thread: f64,
    two_threads: f64,
    two_processes: f64,
    /// The median over rounds of the speed of two threads relative to two processes, and to one thread.
    of_processes: f64,
    of_one: f64,
}

impl fmt::Display for Threads {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let chunk = |seconds: f64| duration(seconds / (self.chunks * PASSES) as f64);
        write!(
            f,
            "{} chunks of caves, {SAMPLES}³ samples of `i16`: {} a chunk on one thread, {} on each of two, {} in each of \
             two processes. Two threads mesh {:.2} times what one does, and {:.2} of what two processes do.",
            self.chunks,
            chunk(self.one_thread),
            chunk(self.two_threads),
            chunk(self.two_processes),
            self.of_one,
            self.of_processes,
        )
    }
}

/// Times the three ways, `rounds` times each, on `per_axis³` chunks.
pub(crate) fn measure(per_axis: usize, rounds: usize) -> Threads {
    let (mut first, mut second) = (Worker::new(per_axis), Worker::new(per_axis));
    let mut processes = [Process::start(per_axis), Process::start(per_axis)];
    let mut times = [const { Vec::new() }; 3];
    for _ in 0..rounds {
        times[0].push(first.round());
        times[1].push(on_two_threads(&mut first, &mut second));
        for process in &mut processes {
            process.go();
        }
        times[2].push(processes.iter_mut().map(Process::seconds).fold(0.0, f64::max));
    }
    let [one, two, apart] = &times;
    let ratios = |a: &[f64], b: &[f64]| median(&mut a.iter().zip(b).map(|(a, b)| a / b).collect::<Vec<_>>());
    let (of_processes, of_one) = (ratios(apart, two), ratios(one, two).map(|ratio| 2.0 * ratio));
    let [one_thread, two_threads, two_processes] = times.map(|mut times| median(&mut times).unwrap_or(f64::NAN));
    Threads {
        chunks: per_axis.pow(3),
        one_thread,
        two_threads,
        two_processes,
        of_processes: of_processes.unwrap_or(f64::NAN),
        of_one: of_one.unwrap_or(f64::NAN),
    }
}

/// Runs this process as a worker: each line of input starts a round, and the answer is its time in seconds.
pub(crate) fn work() {
    let per_axis = env::var(WORKER).ok().and_then(|value| value.parse().ok()).expect("the number of chunks per axis");
    let mut worker = Worker::new(per_axis);
    for line in io::stdin().lines() {
        line.expect("lines come in");
        println!("{}", worker.round());
        io::stdout().flush().expect("the answer is read");
    }
}

/// The time of the slower of two workers on two threads.
fn on_two_threads(first: &mut Worker, second: &mut Worker) -> f64 {
    let barrier = Barrier::new(2);
    let round = |worker: &mut Worker| {
        barrier.wait();
        worker.round()
    };
    thread::scope(|scope| {
        let other = scope.spawn(|| round(second));
        round(first).max(other.join().expect("no panic"))
    })
}

struct Worker {
    chunks: Vec<Vec<i16>>,
    mesher: Mesher,
    mesh: MeshBuffer,
}

impl Worker {
    /// A worker with warm buffers.
    fn new(per_axis: usize) -> Self {
        let size = per_axis * CELLS + SAMPLES - CELLS;
        let samples = Field::Caves.distances(size as u32);
        let chunk = |[x, y, z]: [usize; 3]| {
            let rows = (0..SAMPLES).flat_map(|k| (0..SAMPLES).map(move |j| (z * CELLS + k) * size + y * CELLS + j));
            let samples = rows.flat_map(|row| &samples[row * size + x * CELLS..][..SAMPLES]);
            samples.map(|&distance| i16::from_voxels(distance)).collect()
        };
        let axis = || 0..per_axis;
        let corners = axis().flat_map(|z| axis().flat_map(move |y| axis().map(move |x| [x, y, z])));
        let chunks = corners.map(chunk).collect();
        let mut worker = Self { chunks, mesher: Mesher::new(), mesh: MeshBuffer::new() };
        worker.round();
        worker
    }

    /// Meshes all chunks [`PASSES`] times. Returns the time in seconds.
    fn round(&mut self) -> f64 {
        let (shape, settings) = (Shape::cube(SAMPLES as u32).expect("it is small"), MeshSettings::default());
        let start = Instant::now();
        for _ in 0..PASSES {
            for chunk in &self.chunks {
                let samples = Samples::new(shape, chunk).expect("one weight a sample").padded();
                self.mesher.mesh(samples, &settings, &mut self.mesh).expect("there are cells to mesh");
                core::hint::black_box(&self.mesh);
            }
        }
        start.elapsed().as_secs_f64()
    }
}

/// A worker in a process of its own; it ends when its input does.
struct Process {
    child: Child,
    input: Option<ChildStdin>,
    output: BufReader<ChildStdout>,
}

impl Process {
    fn start(per_axis: usize) -> Self {
        let program = env::current_exe().expect("this program has a path");
        let mut command = Command::new(program);
        command.env(WORKER, per_axis.to_string()).stdin(Stdio::piped()).stdout(Stdio::piped());
        let mut child = command.spawn().expect("this program starts again");
        let output = BufReader::new(child.stdout.take().expect("it is piped"));
        let mut process = Self { input: child.stdin.take(), output, child };
        // The first answer comes when it is ready.
        process.go();
        process.seconds();
        process
    }

    fn go(&mut self) {
        let input = self.input.as_mut().expect("it is piped");
        writeln!(input).and_then(|()| input.flush()).expect("the worker listens");
    }

    fn seconds(&mut self) -> f64 {
        let mut line = String::new();
        self.output.read_line(&mut line).expect("the worker answers");
        line.trim().parse().expect("the worker answers with seconds")
    }
}

impl Drop for Process {
    fn drop(&mut self) {
        self.input = None;
        // A worker's failure after its last answer does not matter.
        let _ = self.child.wait();
    }
}
