//! Rooms' transport of light as it was worked out before, kept on disk by what it was made from: working it out takes
//! seconds, reading it a fraction of one. What cannot be read or written is worked out again; nothing is lost by deleting
//! the folder.

use std::fs;
use std::hash::{DefaultHasher, Hasher};
use std::io::Write;
use std::path::{Path, PathBuf};
use std::sync::Arc;

use crate::geometry::camera::Intrinsics;
use crate::light::Light;
use crate::render::{Gpu, RenderError, Renderer};
use crate::scene::{Scene, plain_file};
use crate::shafts::room::Room;
use crate::shafts::room_transport::RoomTransport;

/// Another layout, or another way to work rooms out.
const VERSION: u32 = 3;
/// Bytes of the largest room that is taken from the disk.
const MOST_ROOM: u64 = 1 << 30;
/// The newest ones stay.
const MOST_ROOMS: usize = 16;

/// A room's transport, and where it was found.
pub struct ReadyRoom {
    /// The transport.
    pub transport: RoomTransport,
    /// The file that it was read from; `None` where it was worked out just now.
    pub read_from: Option<PathBuf>,
}

/// The user's folder for rooms; `None` on systems that have no such place.
pub fn folder() -> Option<PathBuf> {
    Some(dirs::cache_dir()?.join("gnomon").join("rooms"))
}

/// A renderer of a scene whose room's transport is in the user's folder, or is put there.
///
/// # Errors
/// A picture larger than the adapter can hold, or a device that failed.
pub fn renderer(
    gpu: Arc<Gpu>,
    scene: &Scene,
    intrinsics: Intrinsics,
) -> Result<Renderer, RenderError> {
    let transport = |room: &Room<'_>| ready(room, folder().as_deref()).transport;
    Renderer::with_transport(gpu, scene, intrinsics, transport)
}

/// A room's transport from a folder, or worked out and put there.
pub fn ready(room: &Room<'_>, folder: Option<&Path>) -> ReadyRoom {
    let path = folder.map(|folder| folder.join(format!("{:016x}.room", room.key())));
    if let Some(path) = &path
        && let Some(transport) = read(path, &room.compact)
    {
        return ReadyRoom {
            transport,
            read_from: Some(path.clone()),
        };
    }
    let transport = room.transport();
    if let Some(path) = &path {
        keep(path, &transport);
    }
    ReadyRoom {
        transport,
        read_from: None,
    }
}

fn read(path: &Path, compact: &[Light]) -> Option<RoomTransport> {
    let bytes = plain_file::read(path, MOST_ROOM).ok()?;
    let (sum, room) = bytes.split_at_checked(size_of::<u64>())?;
    if sum != checksum(room) {
        return None;
    }
    of_bytes(room, compact)
}

/// A room's transport from what was kept of it, without the checksum; `None` where that is none, or of another version.
pub fn of_bytes(room: &[u8], compact: &[Light]) -> Option<RoomTransport> {
    let (version, transport): (u32, RoomTransport) = postcard::from_bytes(room).ok()?;
    (version == VERSION && transport.is_consistent()).then(|| transport.with_caster(compact))
}

fn checksum(bytes: &[u8]) -> [u8; 8] {
    let mut hasher = DefaultHasher::new();
    hasher.write(bytes);
    hasher.finish().to_le_bytes()
}

/// Whole or not at all; a full disk keeps nothing.
fn keep(path: &Path, transport: &RoomTransport) {
    let kept = || -> Option<()> {
        let folder = path.parent()?;
        fs::create_dir_all(folder).ok()?;
        let bytes = postcard::to_stdvec(&(VERSION, transport)).ok()?;
        let mut file = tempfile::NamedTempFile::new_in(folder).ok()?;
        file.write_all(&checksum(&bytes)).ok()?;
        file.write_all(&bytes).ok()?;
        file.persist(path).ok()?;
        forget_oldest(folder)
    };
    // What is not kept is worked out again.
    let _ = kept();
}

fn forget_oldest(folder: &Path) -> Option<()> {
    let entries = fs::read_dir(folder).ok()?.flatten();
    let rooms = entries.filter(|entry| entry.path().extension().is_some_and(|it| it == "room"));
    let mut rooms: Vec<_> = rooms
        .filter_map(|entry| Some((entry.metadata().ok()?.modified().ok()?, entry.path())))
        .collect();
    rooms.sort();
    let surplus = rooms.len().saturating_sub(MOST_ROOMS);
    for (_, path) in &rooms[..surplus] {
        fs::remove_file(path).ok()?;
    }
    Some(())
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_room_is_read_as_it_was_kept_and_damage_is_worked_out_again() {
        let root = Path::new(env!("CARGO_MANIFEST_DIR"));
        let mut scene = Scene::load(&root.join("config/room.toml")).unwrap();
        scene.shadows.shafts.patches = 300;
        let folder = tempfile::tempdir().unwrap();
        let folder = folder.path();
        let ready_from = |scene: &Scene| {
            let probe = scene.probe.as_ref().unwrap();
            ready(&scene.room(probe), Some(folder))
        };
        let first = ready_from(&scene);
        assert_eq!(first.read_from, None);
        let again = ready_from(&scene);
        let path = again.read_from.unwrap();
        let bytes = |room: &RoomTransport| postcard::to_stdvec(room).unwrap();
        assert!(bytes(&again.transport) == bytes(&first.transport));
        let (origin, down) = (glam::Vec3::new(0.3, 0.2, 0.5), -glam::Vec3::Z);
        let seen = |room: &RoomTransport| room.radiance_along(origin, down);
        assert!(seen(&first.transport).is_some());
        assert_eq!(seen(&again.transport), seen(&first.transport));

        let whole = fs::read(&path).unwrap();
        fs::write(&path, &whole[..whole.len() / 2]).unwrap();
        assert_eq!(ready_from(&scene).read_from, None);
        assert!(fs::read(&path).unwrap() == whole);

        // A checksum says that it is as it was written, not that it is a room.
        let mut odd = first.transport;
        odd.patches.vertices.truncate(5);
        assert!(of_bytes(&postcard::to_stdvec(&(VERSION, &odd)).unwrap(), &[]).is_none());

        // What the room depends on makes it another one.
        scene.probe.as_mut().unwrap().exposure *= 1.5;
        assert_eq!(ready_from(&scene).read_from, None);
        assert_eq!(fs::read_dir(folder).unwrap().count(), 2);
    }
}
