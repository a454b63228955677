//! Writes libtorch's folder into the binary's library search path, so that it runs without LD_LIBRARY_PATH.
use std::path::Path;

fn main() {
    println!("cargo:rerun-if-env-changed=LIBTORCH");
    let libtorch = std::env::var("LIBTORCH").unwrap_or_else(|_| ".libtorch".into());
    println!("cargo:rerun-if-changed={libtorch}/lib/libtorch_cpu.so");
    let lib = Path::new(&libtorch).join("lib");
    let lib = lib.canonicalize().unwrap_or(lib);
    println!("cargo:rustc-link-arg=-Wl,-rpath,{}", lib.display());
    println!("cargo:rustc-env=SPRINT_LIBTORCH_LIB={}", lib.display());
}
