//! [`WorkQueue`]: one queue of jobs by priority, processed by at most as many tasks as the pool has threads.
//!
//! Bevy's task pools have no priorities: with one task per job, sampling would delay edits. Instead, a few tasks take
//! jobs from this queue, the most urgent first. Between two jobs they yield to other users of the pool.

use core::cmp::{Ordering, Reverse};
use core::sync::atomic::{AtomicBool, Ordering::Relaxed};
use std::collections::BinaryHeap;
use std::panic::{AssertUnwindSafe, catch_unwind};
use std::sync::{Arc, Mutex, MutexGuard, PoisonError};

use bevy_ecs::prelude::*;
use bevy_platform::sync::atomic::AtomicU64;
use bevy_tasks::{AsyncComputeTaskPool, futures_lite::future::yield_now};

/// The priority of a job: the kind in this order, then the lowest number first.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub(crate) enum Priority {
    /// Meshing edited chunks.
    Edit,
    /// Planning changes of levels of detail.
    Plan,
    /// Meshing chunks again for new settings.
    Restyle,
    /// Meshing a chunk for the first time.
    FirstMesh(u32),
    /// Sampling a chunk.
    Fill(u32),
    /// Meshing a leaf of a change of levels, by the change's number. Samples come first: changes wait for them.
    Level(u64),
}

/// The jobs that wait for a thread. Dropping the queue drops them.
#[derive(Resource, Default)]
pub(crate) struct WorkQueue(Arc<Shared>);

#[derive(Default)]
struct Shared {
    state: Mutex<State>,
}

#[derive(Default)]
struct State {
    jobs: BinaryHeap<Job>,
    pushed: u64,
    workers: usize,
}

struct Job {
    order: Reverse<(Priority, u64)>,
    claimed: Arc<AtomicBool>,
    run: Box<dyn FnOnce() + Send>,
}

/// A claim on a job's result. Dropping it withdraws the job unless the job has begun.
#[derive(Debug)]
pub(crate) struct Ticket(Arc<AtomicBool>);

impl Ticket {
    /// Withdraws the job. Returns `false` if the job has already begun.
    pub(crate) fn withdraw(&self) -> bool {
        !self.0.swap(true, Relaxed)
    }
}

impl Drop for Ticket {
    fn drop(&mut self) {
        self.withdraw();
    }
}

impl WorkQueue {
    /// Adds a job; it runs after the next [`start`](Self::start) at the earliest.
    pub(crate) fn push(&self, priority: Priority, run: impl FnOnce() + Send + 'static) -> Ticket {
        let claimed = Arc::new(AtomicBool::new(false));
        let mut state = self.0.lock();
        let order = Reverse((priority, state.pushed));
        state.pushed += 1;
        state.jobs.push(Job { order, claimed: claimed.clone(), run: Box::new(run) });
        Ticket(claimed)
    }

    /// Starts tasks for pending jobs. With a budget, or without a task pool, runs jobs at once instead: as many as the
    /// budget says, by default 8.
    pub(crate) fn start(&self, budget: Option<usize>) {
        match (budget, AsyncComputeTaskPool::try_get()) {
            (None, Some(pool)) => {
                let mut state = self.0.lock();
                let wanted = state.jobs.len().min(pool.thread_num().max(1));
                while state.workers < wanted {
                    state.workers += 1;
                    pool.spawn(work(self.0.clone())).detach();
                }
            }
            (budget, _) => {
                for _ in 0..budget.unwrap_or(8) {
                    if !do_next(self) {
                        break;
                    }
                }
            }
        }
    }
}

impl Drop for WorkQueue {
    fn drop(&mut self) {
        self.0.lock().jobs.clear();
    }
}

impl Shared {
    fn lock(&self) -> MutexGuard<'_, State> {
        self.state.lock().unwrap_or_else(PoisonError::into_inner)
    }

    /// Takes the most urgent job that is not withdrawn.
    fn take(&self) -> Option<Box<dyn FnOnce() + Send>> {
        take(&mut self.lock())
    }

    /// Takes a job like [`Shared::take`], or counts the worker out if there is none.
    fn take_or_leave(&self) -> Option<Box<dyn FnOnce() + Send>> {
        let mut state = self.lock();
        let job = take(&mut state);
        if job.is_none() {
            state.workers -= 1;
        }
        job
    }
}

fn take(state: &mut State) -> Option<Box<dyn FnOnce() + Send>> {
    while let Some(job) = state.jobs.pop() {
        if !job.claimed.swap(true, Relaxed) {
            return Some(job.run);
        }
    }
    None
}

/// Runs a job. Jobs report their own failures; a panic that escapes must not take the worker with it.
fn run(job: Box<dyn FnOnce() + Send>) {
    if catch_unwind(AssertUnwindSafe(job)).is_err() {
        bevy_log::error!("a terrain job panicked; its result is lost");
    }
}

async fn work(shared: Arc<Shared>) {
    while let Some(job) = shared.take_or_leave() {
        run(job);
        yield_now().await;
    }
}

/// Runs the most urgent job on this thread; `false` if the queue is empty.
pub(crate) fn do_next(queue: &WorkQueue) -> bool {
    let job = queue.0.take();
    let found = job.is_some();
    job.into_iter().for_each(run);
    found
}

/// A process-unique, increasing id; tells stale results from new ones.
pub(crate) fn new_number() -> u64 {
    static LAST: AtomicU64 = AtomicU64::new(0);
    LAST.fetch_add(1, Relaxed) + 1
}

/// The finished results of one terrain's jobs. They wait here until taken or until the terrain is dropped.
pub(crate) struct Results<T>(Arc<Mutex<Vec<T>>>);

impl<T> Results<T> {
    pub(crate) fn push(&self, result: T) {
        self.0.lock().unwrap_or_else(PoisonError::into_inner).push(result);
    }

    pub(crate) fn is_empty(&self) -> bool {
        self.0.lock().unwrap_or_else(PoisonError::into_inner).is_empty()
    }

    /// Takes all results since the last call, in the order in which they were made.
    pub(crate) fn take(&self) -> Vec<T> {
        core::mem::take(&mut *self.0.lock().unwrap_or_else(PoisonError::into_inner))
    }
}

impl<T> Clone for Results<T> {
    fn clone(&self) -> Self {
        Self(self.0.clone())
    }
}

impl<T> Default for Results<T> {
    fn default() -> Self {
        Self(Arc::default())
    }
}

impl PartialEq for Job {
    fn eq(&self, other: &Self) -> bool {
        self.order == other.order
    }
}

impl Eq for Job {}

impl PartialOrd for Job {
    fn partial_cmp(&self, other: &Self) -> Option<Ordering> {
        Some(self.cmp(other))
    }
}

impl Ord for Job {
    fn cmp(&self, other: &Self) -> Ordering {
        self.order.cmp(&other.order)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn queue_of(priorities: &[Priority]) -> (WorkQueue, Vec<Ticket>, Results<Priority>) {
        let (queue, results) = (WorkQueue::default(), Results::default());
        let push = |&priority: &Priority| {
            let results = results.clone();
            queue.push(priority, move || results.push(priority))
        };
        let tickets = priorities.iter().map(push).collect();
        (queue, tickets, results)
    }

    #[test]
    fn the_most_urgent_job_comes_first() {
        use Priority::{Edit, Fill, FirstMesh};
        let (queue, _tickets, results) = queue_of(&[Fill(0), FirstMesh(2), Edit, FirstMesh(1)]);
        for _ in 0..5 {
            do_next(&queue);
        }
        assert_eq!(results.take(), [Edit, FirstMesh(1), FirstMesh(2), Fill(0)]);
    }

    #[test]
    fn dropping_a_ticket_withdraws_its_job_unless_it_has_begun() {
        let (queue, mut tickets, results) = queue_of(&[Priority::Fill(0), Priority::Fill(1), Priority::Fill(2)]);
        do_next(&queue);
        assert!(!tickets.remove(0).withdraw(), "it has run");
        drop(tickets.remove(0));
        do_next(&queue);
        do_next(&queue);
        assert_eq!(results.take(), [Priority::Fill(0), Priority::Fill(2)]);
    }

    #[test]
    fn a_panicking_job_does_not_stop_the_next() {
        let queue = WorkQueue::default();
        let results = Results::default();
        let _bad = queue.push(Priority::Edit, || panic!("on purpose"));
        let _good = queue.push(Priority::Edit, {
            let results = results.clone();
            move || results.push(1)
        });
        do_next(&queue);
        do_next(&queue);
        assert_eq!(results.take(), [1]);
    }
}
