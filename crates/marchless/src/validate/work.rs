//! [`Work`]: runs the parts of a job in turn or on several threads, and tells the caller how far it is.

use alloc::vec::Vec;
use core::ops::ControlFlow;

/// The callback that receives the share of the work done, from 0 to 1, and decides whether to go on.
pub(super) type Progress<'a> = &'a mut dyn FnMut(f32) -> ControlFlow<()>;

/// Runs jobs part by part, and keeps track of progress.
pub(super) struct Work<'a> {
    threads: usize,
    progress: Progress<'a>,
    /// The share of the whole that is done, from 0 to 1.
    done: f32,
}

impl<'a> Work<'a> {
    /// `threads`: at least 1, the caller's among them. Without feature `std` only the caller's is used.
    pub(super) const fn new(threads: usize, progress: Progress<'a>) -> Self {
        Self { threads, progress, done: 0.0 }
    }

    /// How many threads there are.
    pub(super) const fn threads(&self) -> usize {
        self.threads
    }

    /// Runs `job` on all parts; returns the results in the order of the parts, or `None` if the caller has cancelled.
    ///
    /// `share`: how much of the whole this is, from 0 to 1.
    pub(super) fn map<P, R: Send>(
        &mut self,
        share: f32,
        parts: impl ExactSizeIterator<Item = P> + Send,
        job: impl Fn(P) -> R + Sync,
    ) -> Option<Vec<R>> {
        self.map_while(share, parts, job, |_| true)
    }

    /// Like [`map`](Self::map), but starts no more parts after `proceed` has returned false for a result. Which parts
    /// have been started by then depends on the threads.
    pub(super) fn map_while<P, R: Send>(
        &mut self,
        share: f32,
        parts: impl ExactSizeIterator<Item = P> + Send,
        job: impl Fn(P) -> R + Sync,
        proceed: impl FnMut(&R) -> bool + Send,
    ) -> Option<Vec<R>> {
        let (before, len) = (self.done, parts.len());
        let tell = |finished: usize| (self.progress)(before + share * (finished as f32 / len as f32));
        let results = if self.threads == 1 || len <= 1 {
            in_turn(parts, job, proceed, tell)
        } else {
            on_threads(self.threads.min(len), parts, job, proceed, tell)
        };
        self.done += share;
        results
    }
}

/// `tell`: is told how many parts are finished, after each.
fn in_turn<P, R>(
    parts: impl Iterator<Item = P>,
    job: impl Fn(P) -> R,
    mut proceed: impl FnMut(&R) -> bool,
    mut tell: impl FnMut(usize) -> ControlFlow<()>,
) -> Option<Vec<R>> {
    let mut results = Vec::new();
    for part in parts {
        let result = job(part);
        let proceeds = proceed(&result);
        results.push(result);
        if tell(results.len()).is_break() {
            return None;
        }
        if !proceeds {
            break;
        }
    }
    Some(results)
}

/// Without `std` there are no threads.
#[cfg(not(feature = "std"))]
fn on_threads<P, R>(
    _threads: usize,
    parts: impl Iterator<Item = P>,
    job: impl Fn(P) -> R,
    proceed: impl FnMut(&R) -> bool,
    tell: impl FnMut(usize) -> ControlFlow<()>,
) -> Option<Vec<R>> {
    in_turn(parts, job, proceed, tell)
}

/// Like [`in_turn`], with the parts handed out to several threads; only the caller's thread calls `tell`.
///
/// Where the system has no more threads to give, fewer do the work.
#[cfg(feature = "std")]
fn on_threads<P, R: Send>(
    threads: usize,
    parts: impl Iterator<Item = P> + Send,
    job: impl Fn(P) -> R + Sync,
    proceed: impl FnMut(&R) -> bool + Send,
    mut tell: impl FnMut(usize) -> ControlFlow<()>,
) -> Option<Vec<R>> {
    use std::{
        panic::resume_unwind,
        sync::{Mutex, MutexGuard, PoisonError},
        thread,
    };

    struct Queue<I, F> {
        parts: I,
        proceed: F,
        finished: usize,
        stopped: bool,
    }
    fn lock<T>(mutex: &Mutex<T>) -> MutexGuard<'_, T> {
        mutex.lock().unwrap_or_else(PoisonError::into_inner)
    }

    let queue = Mutex::new(Queue { parts: parts.enumerate(), proceed, finished: 0, stopped: false });
    let next = || {
        let mut queue = lock(&queue);
        if queue.stopped { None } else { queue.parts.next() }
    };
    // Runs one part, and returns how many are finished.
    let run = |(index, part): (usize, P), results: &mut Vec<(usize, R)>| {
        let result = job(part);
        let mut queue = lock(&queue);
        queue.finished += 1;
        let proceeds = (queue.proceed)(&result);
        queue.stopped |= !proceeds;
        results.push((index, result));
        queue.finished
    };
    let help = || {
        let mut results = Vec::new();
        while let Some(part) = next() {
            run(part, &mut results);
        }
        results
    };
    thread::scope(|scope| {
        let helpers = (1..threads).filter_map(|_| thread::Builder::new().spawn_scoped(scope, help).ok());
        let helpers: Vec<_> = helpers.collect();
        let (mut results, mut cancelled) = (Vec::new(), false);
        while let Some(part) = next() {
            if tell(run(part, &mut results)).is_break() {
                cancelled = true;
                lock(&queue).stopped = true;
            }
        }
        for helper in helpers {
            results.extend(helper.join().unwrap_or_else(|panic| resume_unwind(panic)));
        }
        results.sort_unstable_by_key(|&(index, _)| index);
        (!cancelled).then(|| results.into_iter().map(|(_, result)| result).collect())
    })
}
