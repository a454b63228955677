//! Which libtorch is loaded, and on what it computes.

use std::path::{Path, PathBuf};
use std::sync::Once;

pub(crate) use tch::Device;

/// The libtorch version that the bindings are written for.
pub(crate) const LIBTORCH_VERSION: &str = "2.11.0";

/// The best device that is there: the first CUDA device where libtorch's CUDA part could be loaded, else the CPU.
pub fn best_device() -> Device {
    load_cuda();
    Device::cuda_if_available()
}

/// What computes, for reports: `CPU`, `CUDA (2 devices)`, or `CPU` with the reason why a CUDA part is not used.
pub(crate) fn device_report() -> String {
    load_cuda();
    match (best_device(), cuda_part().is_file()) {
        (Device::Cuda(_), _) => format!("CUDA ({} devices)", tch::Cuda::device_count()),
        (_, true) => "CPU (libtorch's CUDA part is there, but finds no usable GPU)".into(),
        (_, false) => "CPU".into(),
    }
}

/// Bytes of memory that are free where it computes, if the system tells.
pub(crate) fn free_memory(device: Device) -> Option<u64> {
    let first_number = |text: &str| text.split_whitespace().next()?.parse::<u64>().ok();
    match device {
        Device::Cuda(_) => {
            let visible = std::env::var("CUDA_VISIBLE_DEVICES").unwrap_or_default();
            let first = visible.split(',').next().filter(|first| !first.is_empty()).unwrap_or("0").to_owned();
            let asked = ["--query-gpu=memory.free", "--format=csv,noheader,nounits", "-i", &first];
            let told = std::process::Command::new("nvidia-smi").args(asked).output().ok()?;
            first_number(&String::from_utf8_lossy(&told.stdout)).map(|megabytes| megabytes << 20)
        }
        _ => {
            let told = std::fs::read_to_string("/proc/meminfo").ok()?;
            let available = told.lines().find_map(|line| line.strip_prefix("MemAvailable:"))?;
            first_number(available).map(|kilobytes| kilobytes << 10)
        }
    }
}

/// How many threads libtorch computes with.
pub(crate) fn threads() -> usize {
    usize::try_from(tch::get_num_threads()).unwrap_or(1)
}

/// Sets how many threads libtorch computes with, on the calling thread and on those that compute for the first time
/// after it.
pub fn set_threads(count: usize) {
    tch::set_num_threads(i32::try_from(count.max(1)).unwrap_or(i32::MAX));
}

/// The libtorch folder that this binary is linked to.
pub(crate) fn libtorch_folder() -> PathBuf {
    let lib = Path::new(env!("SPRINT_LIBTORCH_LIB"));
    lib.parent().unwrap_or(lib).to_path_buf()
}

/// The version that a libtorch folder says it is, from its headers or a `build-version`
/// file; a suffix such as `+cpu` is left off.
pub(crate) fn version_in(folder: &Path) -> Option<String> {
    let header = std::fs::read_to_string(folder.join("include/torch/headeronly/version.h")).unwrap_or_default();
    if let Some((_, rest)) = header.split_once("#define TORCH_VERSION \\") {
        return rest.split('"').nth(1).map(str::to_string);
    }
    let written = std::fs::read_to_string(folder.join("build-version")).ok()?;
    Some(written.trim().split('+').next()?.to_string())
}

/// Where libtorch's CUDA part would be: beside the CPU part that this binary is linked to.
fn cuda_part() -> PathBuf {
    Path::new(env!("SPRINT_LIBTORCH_LIB")).join("libtorch_cuda.so")
}

/// Loads `libtorch_cuda.so` once, where it lies beside the CPU part, so that one binary serves both.
///
/// The linker drops the library because nothing refers to it by name; loading it registers its kernels.
fn load_cuda() {
    static LOADED: Once = Once::new();
    LOADED.call_once(|| {
        let part = cuda_part();
        if part.is_file() {
            open_library(&part);
        }
    });
}

/// One of the two unsafe calls of the program.
#[allow(unsafe_code)]
fn open_library(path: &Path) {
    use std::os::unix::ffi::OsStrExt;

    let Ok(name) = std::ffi::CString::new(path.as_os_str().as_bytes()) else { return };
    // SAFETY: `name` is a NUL-terminated path that outlives the call. Loading runs the library's initialisers, which
    // only register kernels with the libtorch that is already loaded; the handle is never closed.
    let handle = unsafe { libc::dlopen(name.as_ptr(), libc::RTLD_NOW | libc::RTLD_GLOBAL) };
    if handle.is_null() {
        tracing::warn!(library = %path.display(), "libtorch's CUDA part could not be loaded; computing on the CPU");
    } else {
        tracing::info!(library = %path.display(), "loaded libtorch's CUDA part");
    }
}
