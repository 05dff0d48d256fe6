//! A GPU that fails: a Vulkan layer between the program and its driver, made when it is first wanted.

use std::path::{Path, PathBuf};
use std::process::Command;
use std::sync::OnceLock;

use super::project_file;

const NAME: &str = "VK_LAYER_gnomon_faults";

/// The folder of the layer and its description.
fn folder() -> &'static Path {
    static FOLDER: OnceLock<PathBuf> = OnceLock::new();
    FOLDER.get_or_init(|| {
        let folder = Path::new(env!("CARGO_TARGET_TMPDIR")).join("gpu_faults");
        std::fs::create_dir_all(&folder).expect("a folder");
        let made = tempfile::NamedTempFile::new_in(&folder).expect("a place");
        let built = Command::new("clang")
            .args(["-std=c11", "-O1", "-shared", "-fPIC", "-o"])
            .arg(made.path())
            .arg(project_file("tests/common/gpu_faults.c"))
            .status()
            .expect("clang");
        assert!(built.success());
        made.persist(folder.join("libgpu_faults.so")).expect("a place");
        let description = format!(
            "{{\"file_format_version\": \"1.0.0\", \"layer\": {{\"name\": \"{NAME}\", \"type\": \"GLOBAL\", \
             \"library_path\": \"./libgpu_faults.so\", \"api_version\": \"1.3.0\", \
             \"implementation_version\": \"1\", \"description\": \"A GPU that fails\"}}}}"
        );
        std::fs::write(folder.join("gpu_faults.json"), description).expect("a place");
        folder
    })
}

/// Lets the GPU of a program fail: `submit 3`, `wait 3`, `memory 3`, or `file PATH`, once that is there.
pub fn let_fail<'a>(command: &'a mut Command, fault: &str) -> &'a mut Command {
    command
        .env("VK_ADD_LAYER_PATH", folder())
        .env("VK_INSTANCE_LAYERS", NAME)
        .env("GNOMON_TEST_GPU_FAULT", fault)
}
