//! Work split among the processor's cores.

use std::panic::resume_unwind;

/// Splits `0..count` among the cores; the results come in order.
pub(crate) fn on_all_cores<T: Send>(
    count: usize,
    work: impl Fn(std::ops::Range<usize>) -> T + Sync,
) -> Vec<T> {
    let threads = std::thread::available_parallelism().map_or(1, |threads| threads.get());
    let share = count.div_ceil(threads).max(1);
    std::thread::scope(|scope| {
        let ranges = (0..count)
            .step_by(share)
            .map(|first| first..count.min(first + share));
        let work = &work;
        let workers: Vec<_> = ranges
            .map(|range| scope.spawn(move || work(range)))
            .collect();
        let join = |worker: std::thread::ScopedJoinHandle<'_, T>| {
            worker.join().unwrap_or_else(|panic| resume_unwind(panic))
        };
        workers.into_iter().map(join).collect()
    })
}
