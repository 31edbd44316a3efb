//! An allocator that counts: libFuzzer's own limit of single allocations needs a sanitizer, which needs nightly Rust.

use std::alloc::{GlobalAlloc, Layout, System};
use std::io::Write;
use std::sync::atomic::{AtomicUsize, Ordering};

/// What reading one input may hold at once, bytes. Inputs have kilobytes; an image of them has at most 32 KiB a byte.
const MOST: usize = 512 << 20;

static LIVE: AtomicUsize = AtomicUsize::new(0);
static LIMIT: AtomicUsize = AtomicUsize::new(usize::MAX);

/// The system's allocator, counting.
pub struct Counting;

/// From here on no more than [`MOST`] may be added.
pub fn watch() {
    LIMIT.store(LIVE.load(Ordering::Relaxed).saturating_add(MOST), Ordering::Relaxed);
}

/// Until here.
pub fn rest() {
    LIMIT.store(usize::MAX, Ordering::Relaxed);
}

fn took(size: usize) {
    let live = LIVE.fetch_add(size, Ordering::Relaxed).wrapping_add(size);
    if live > LIMIT.load(Ordering::Relaxed) {
        rest();
        // Nothing is allocated on the way to standard error.
        let _ = std::io::stderr().write_all(b"memory: the input asks for more than 512 MiB\n");
        std::process::abort();
    }
}

fn gave(size: usize) {
    LIVE.fetch_sub(size, Ordering::Relaxed);
}

// SAFETY: every call goes to the system's allocator as it came; counting touches two numbers.
unsafe impl GlobalAlloc for Counting {
    unsafe fn alloc(&self, layout: Layout) -> *mut u8 {
        took(layout.size());
        unsafe { System.alloc(layout) }
    }

    unsafe fn alloc_zeroed(&self, layout: Layout) -> *mut u8 {
        took(layout.size());
        unsafe { System.alloc_zeroed(layout) }
    }

    unsafe fn dealloc(&self, at: *mut u8, layout: Layout) {
        gave(layout.size());
        unsafe { System.dealloc(at, layout) }
    }

    unsafe fn realloc(&self, at: *mut u8, layout: Layout, size: usize) -> *mut u8 {
        took(size);
        gave(layout.size());
        unsafe { System.realloc(at, layout, size) }
    }
}
