//! Work on a thread of its own in, its outcome out; meanwhile a bar on standard error, and Ctrl-C passed on.

use std::sync::atomic::{AtomicBool, Ordering};
use std::time::Duration;

use indicatif::{ProgressBar, ProgressStyle};

use super::interrupt;

/// How often the bar moves.
const INTERVAL: Duration = Duration::from_millis(20);

/// Does something while `show` moves the bar and a Ctrl-C sets `cancelled`, which the work looks at.
pub fn watched<T: Send>(
    bar: &ProgressBar,
    cancelled: &AtomicBool,
    show: impl Fn(&ProgressBar),
    work: impl FnOnce() -> T + Send,
) -> T {
    let flag = interrupt::flag();
    std::thread::scope(|scope| {
        let work = scope.spawn(work);
        while !work.is_finished() {
            cancelled.store(flag.load(Ordering::Relaxed), Ordering::Relaxed);
            show(bar);
            std::thread::sleep(INTERVAL);
        }
        bar.finish_and_clear();
        work.join().unwrap_or_else(|panic| std::panic::resume_unwind(panic))
    })
}

/// The style of a constant template.
pub fn style(template: &str) -> ProgressStyle {
    // indicatif has parsed the templates in every test of the verbs.
    ProgressStyle::with_template(template).unwrap_or_else(|_| ProgressStyle::default_bar())
}
