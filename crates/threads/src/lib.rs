//! Provides a thread pool that belongs to the process that asks.
//!
//! A fork copies the memory of a thread pool and none of its threads: work handed to such a pool waits for ever.
//! rayon's global pool is built once and never anew, so nothing that Python can reach may use it: a parent that used
//! pydpend would leave the workers of its `multiprocessing.Pool` hanging. What is shared out by rayon goes through
//! [`install`].

use std::sync::{Arc, Mutex};

use rayon::{ThreadPool, ThreadPoolBuildError, ThreadPoolBuilder};

/// The pool and the process that built it.
static POOL: Mutex<Option<(u32, Arc<ThreadPool>)>> = Mutex::new(None);

/// Does `work`, whose parallel iterators then run on a pool of this process with one thread for each core; on the
/// pool that the caller is in, if it is in one.
///
/// # Panics
/// If no thread at all can be started.
pub fn install<T: Send>(work: impl FnOnce() -> T + Send) -> T {
    if rayon::current_thread_index().is_some() {
        return work();
    }
    match pool() {
        Ok(pool) => pool.install(work),
        // The system gives no more threads: rayon then works on the one that asks, if it may.
        Err(_) => work(),
    }
}

/// Number of threads that [`install`] shares work out to.
#[must_use]
pub fn count() -> usize {
    if rayon::current_thread_index().is_some() { rayon::current_num_threads() } else { cores() }
}

fn cores() -> usize {
    std::thread::available_parallelism().map_or(1, usize::from)
}

fn build() -> Result<ThreadPool, ThreadPoolBuildError> {
    ThreadPoolBuilder::new().num_threads(cores()).build()
}

fn pool() -> Result<Arc<ThreadPool>, ThreadPoolBuildError> {
    // Held by a thread of the parent while it forked, the lock is never given back in the child, nor while another
    // thread builds the pool: either way a pool for this call alone does.
    let Ok(mut held) = POOL.try_lock() else { return build().map(Arc::new) };
    let process = std::process::id();
    if let Some((owner, pool)) = held.as_ref()
        && *owner == process
    {
        return Ok(Arc::clone(pool));
    }
    let pool = Arc::new(build()?);
    if let Some((_, inherited)) = held.replace((process, Arc::clone(&pool))) {
        // To drop it would be to wait for the parent's threads.
        std::mem::forget(inherited);
    }
    Ok(pool)
}

#[cfg(test)]
mod tests {
    use std::sync::mpsc::channel;
    use std::time::Duration;

    use rayon::prelude::*;

    use super::*;

    /// The tests hold the one pool's lock, so one at a time.
    static ALONE: Mutex<()> = Mutex::new(());

    fn sum() -> u64 {
        (0..10_000u64).into_par_iter().sum()
    }

    #[test]
    fn one_pool_serves_all_calls_and_calls_from_within() {
        let _alone = ALONE.lock();
        let first = pool().unwrap();
        assert_eq!(install(|| install(sum)), 49_995_000);
        assert!(Arc::ptr_eq(&first, &pool().unwrap()));
        assert_eq!(install(count), cores());
    }

    #[test]
    fn a_pool_of_another_process_is_not_waited_for() {
        let _alone = ALONE.lock();
        // As a fork leaves it: the lock held by a thread that is not there.
        let (tell, told) = channel();
        let (release, released) = channel::<()>();
        let holder = std::thread::spawn(move || {
            let _held = POOL.lock();
            tell.send(()).unwrap();
            let _ = released.recv_timeout(Duration::from_secs(20));
        });
        told.recv().unwrap();
        assert_eq!(install(sum), 49_995_000);
        release.send(()).unwrap();
        holder.join().unwrap();
    }
}
