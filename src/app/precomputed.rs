//! What takes seconds to work out before a scene's first frame, kept on disk by what it was made from: rooms' transport of light,
//! and what things hide from themselves.

use std::path::PathBuf;
use std::sync::Arc;

use bytemuck::Zeroable as _;

use crate::environment::finer::{self, Cuts};
use crate::environment::self_occlusion::{OwnSpace, OwnSurface, SelfOcclusion};
use crate::geometry::camera::Intrinsics;
use crate::geometry::levels::{Level, levels_while};
use crate::geometry::mesh::Mesh;
use crate::light::Light;
use crate::render::{Gpu, Precomputation, RenderError, Renderer};
use crate::scene::Scene;
use crate::shafts::room::Room;
use crate::shafts::room_transport::RoomTransport;

use super::disk_cache::DiskCache;

/// A room's transport, and where it was found.
pub struct ReadyRoom {
    /// The transport.
    pub transport: RoomTransport,
    /// The file that it was read from; `None` where it was worked out just now.
    pub read_from: Option<PathBuf>,
}

/// The user's folder for something; `None` on systems that have no such place.
fn folder(name: &str) -> Option<PathBuf> {
    Some(dirs::cache_dir()?.join("gnomon").join(name))
}

/// Rooms in a folder.
fn rooms(folder: Option<PathBuf>) -> DiskCache {
    DiskCache {
        folder,
        extension: "room",
        version: 4,
        most_bytes: 1 << 30,
        most_files: 16,
    }
}

/// Things' self-occlusion in a folder.
fn self_occlusions(folder: Option<PathBuf>) -> DiskCache {
    DiskCache {
        folder,
        extension: "occlusion",
        version: 3,
        most_bytes: 1 << 28,
        most_files: 64,
    }
}

/// Where things' meshes are made finer, in a folder.
fn cuts_of_meshes(folder: Option<PathBuf>) -> DiskCache {
    DiskCache {
        folder,
        extension: "cuts",
        version: 4,
        most_bytes: 1 << 24,
        most_files: 64,
    }
}

/// Who is told how far something has come that takes long.
pub trait Onlooker: Sync {
    /// So many points of so many are done. Returns whether it is to go on.
    fn sees(&self, done: usize, of: usize) -> bool;

    /// Whether it is to go on, where nobody can tell how far it is.
    fn goes_on(&self) -> bool;
}

/// Nobody.
pub struct NoOnlooker;

impl Onlooker for NoOnlooker {
    fn sees(&self, _done: usize, _of: usize) -> bool {
        true
    }

    fn goes_on(&self) -> bool {
        true
    }
}

/// What is in the user's folders, or is put there. Where an onlooker stops it, it gives anything that does: what is made of that is
/// not to be drawn.
struct KeptOnDisk<'a>(&'a dyn Onlooker);

impl Precomputation for KeptOnDisk<'_> {
    fn transport(&self, room: &Room<'_>) -> RoomTransport {
        ready_room(room).transport
    }

    fn goes_on(&self) -> bool {
        self.0.goes_on()
    }

    fn levels(&self, mesh: &Mesh) -> Vec<Level> {
        levels_while(mesh, &|| self.0.goes_on())
    }

    fn self_occlusions(&self, surface: &OwnSurface) -> Vec<SelfOcclusion> {
        occlusions(surface, &self_occlusions(folder("self-occlusion")), self.0)
    }

    fn cuts(&self, mesh: &Mesh, space: &OwnSpace) -> Cuts {
        // (Most meshes are fine enough, which is seen at once.)
        match finer::is_coarse(mesh, space) {
            true => cuts(
                mesh,
                space,
                &cuts_of_meshes(folder("self-occlusion")),
                self.0,
            ),
            false => Cuts::new(),
        }
    }
}

/// A renderer of a scene for which what takes long is in the user's folders, or is put there.
///
/// # Errors
/// A picture larger than the adapter can hold, or a device that failed.
pub fn renderer(
    gpu: Arc<Gpu>,
    scene: &Scene,
    intrinsics: Intrinsics,
) -> Result<Renderer, RenderError> {
    watched_renderer(gpu, scene, intrinsics, &NoOnlooker)
}

/// The same, which somebody looks on at, and may stop; the renderer then is of no use.
///
/// # Errors
/// A picture larger than the adapter can hold, or a device that failed.
pub fn watched_renderer(
    gpu: Arc<Gpu>,
    scene: &Scene,
    intrinsics: Intrinsics,
    onlooker: &dyn Onlooker,
) -> Result<Renderer, RenderError> {
    Renderer::with_precomputation(gpu, scene, intrinsics, &KeptOnDisk(onlooker))
}

/// A room's transport from the user's folder, or worked out and put there.
pub fn ready_room(room: &Room<'_>) -> ReadyRoom {
    ready(room, &rooms(folder("rooms")))
}

fn ready(room: &Room<'_>, rooms: &DiskCache) -> ReadyRoom {
    let key = room.key();
    let known: Option<RoomTransport> = rooms.read(key);
    if let Some(transport) = known.and_then(|it| consistent(it, &room.compact)) {
        return ReadyRoom {
            transport,
            read_from: rooms.path(key),
        };
    }
    let transport = room.transport();
    rooms.keep(key, &transport);
    ReadyRoom {
        transport,
        read_from: None,
    }
}

/// A room's transport from what was kept of it, without the checksum; `None` where that is none, or of another version.
pub fn room_of_bytes(contents: &[u8], compact: &[Light]) -> Option<RoomTransport> {
    consistent(rooms(None).decoded(contents)?, compact)
}

/// A checksum says that it is as it was written, not that it is a room.
fn consistent(transport: RoomTransport, compact: &[Light]) -> Option<RoomTransport> {
    transport
        .is_consistent()
        .then(|| transport.with_caster(compact))
}

fn cuts(mesh: &Mesh, space: &OwnSpace, cache: &DiskCache, onlooker: &dyn Onlooker) -> Cuts {
    let key = space.key(mesh);
    let known: Option<Cuts> = cache.read(key);
    known.unwrap_or_else(|| {
        let cuts = finer::cuts(mesh, space, &|| onlooker.goes_on());
        if let Some(cuts) = &cuts {
            cache.keep(key, cuts);
        }
        cuts.unwrap_or_default()
    })
}

fn occlusions(
    surface: &OwnSurface,
    cache: &DiskCache,
    onlooker: &dyn Onlooker,
) -> Vec<SelfOcclusion> {
    let known: Option<Vec<f32>> = cache.read(surface.kept_as());
    let known = known.and_then(|numbers| {
        let occlusions = bytemuck::try_cast_slice(&numbers).ok()?.to_vec();
        (occlusions.len() == surface.point_count()).then_some(occlusions)
    });
    known.unwrap_or_else(|| {
        let count = surface.point_count();
        let occlusions = surface.self_occlusions_while(&|done| onlooker.sees(done, count));
        onlooker.sees(count, count);
        let Some(occlusions) = occlusions else {
            return vec![SelfOcclusion::zeroed(); count];
        };
        let numbers: &[f32] = bytemuck::cast_slice(&occlusions);
        cache.keep(surface.kept_as(), &numbers);
        occlusions
    })
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::environment::self_occlusion::OwnSpace;
    use std::fs;
    use std::path::Path;

    #[test]
    fn what_a_thing_hides_from_itself_is_kept_whichever_way_it_is_turned_and_evenly_scaled() {
        let root = Path::new(env!("CARGO_MANIFEST_DIR"));
        let scene = Scene::load(&root.join("config/lamp.toml")).unwrap();
        let torus = &scene.virtuals[0];
        let folder = tempfile::tempdir().unwrap();
        let cache = self_occlusions(Some(folder.path().to_owned()));
        let kept = || fs::read_dir(folder.path()).unwrap().count();
        let surface = |scale: glam::DVec3, turned: f64| {
            let place = glam::DAffine3::from_rotation_x(turned) * glam::DAffine3::from_scale(scale);
            OwnSurface::new(
                &torus.mesh,
                std::iter::once(torus.mesh.as_ref()),
                &OwnSpace::new(&place),
            )
        };
        let first = occlusions(&surface(glam::DVec3::ONE, 0.3), &cache, &NoOnlooker);
        assert_eq!(
            (first.len(), kept()),
            (surface(glam::DVec3::ONE, 0.0).point_count(), 1)
        );
        let turned = surface(glam::DVec3::splat(2.0), 1.3);
        let path = cache.path(turned.kept_as()).unwrap();
        let as_kept = fs::read(&path).unwrap();
        assert!(occlusions(&turned, &cache, &NoOnlooker) == first && kept() == 1);
        assert!(turned.self_occlusions() == first);
        // Another form is another thing; damage is worked out again.
        let squeezed = surface(glam::DVec3::new(1.0, 1.0, 0.5), 0.3);
        assert!(occlusions(&squeezed, &cache, &NoOnlooker) != first && kept() == 2);
        fs::write(&path, &as_kept[..100]).unwrap();
        assert!(
            occlusions(&turned, &cache, &NoOnlooker) == first
                && fs::read(&path).unwrap() == as_kept
        );
    }

    /// Keeps what it saw, and stops what it sees after some.
    struct Counting {
        seen: std::sync::Mutex<Vec<usize>>,
        most: usize,
    }

    impl Onlooker for Counting {
        fn sees(&self, done: usize, _of: usize) -> bool {
            let mut seen = self.seen.lock().unwrap();
            seen.push(done);
            seen.len() <= self.most
        }

        fn goes_on(&self) -> bool {
            self.sees(0, 0)
        }
    }

    #[test]
    fn an_onlooker_sees_all_points_done_and_what_it_stops_is_not_kept() {
        let root = Path::new(env!("CARGO_MANIFEST_DIR"));
        let scene = Scene::load(&root.join("config/lamp.toml")).unwrap();
        let house = scene.phantoms.iter().find(|it| it.name == "house");
        let (house, torus) = (&house.unwrap().mesh, &scene.virtuals[0].mesh);
        let space = OwnSpace::new(&glam::DAffine3::IDENTITY);
        let surface = OwnSurface::new(torus, std::iter::once(torus.as_ref()), &space);
        let folder = tempfile::tempdir().unwrap();
        let folder = Some(folder.path().to_owned());
        let [points, edges] = [self_occlusions(folder.clone()), cuts_of_meshes(folder)];
        let onlooker = |most: usize| Counting {
            seen: Default::default(),
            most,
        };
        let stops = onlooker(3);
        occlusions(&surface, &points, &stops);
        assert_eq!(points.read::<Vec<f32>>(surface.kept_as()), None);
        assert!(finer::is_coarse(house, &space));
        assert_eq!(cuts(house, &space, &edges, &onlooker(0)), Cuts::new());
        assert_eq!(edges.read::<Cuts>(space.key(house)), None);
        let looks_on = onlooker(usize::MAX);
        let all = occlusions(&surface, &points, &looks_on);
        let seen = looks_on.seen.into_inner().unwrap();
        assert_eq!(seen.last(), Some(&all.len()));
        assert!(seen.len() > 10 && seen.iter().all(|&done| done <= all.len()));
        assert!(points.read::<Vec<f32>>(surface.kept_as()).is_some());
        let found = cuts(house, &space, &edges, &onlooker(usize::MAX));
        assert_eq!(edges.read(space.key(house)), Some(found));
    }

    #[test]
    fn a_room_is_read_as_it_was_kept_and_damage_is_worked_out_again() {
        let root = Path::new(env!("CARGO_MANIFEST_DIR"));
        let mut scene = Scene::load(&root.join("config/room.toml")).unwrap();
        scene.shadows.shafts.patches = 300;
        let folder = tempfile::tempdir().unwrap();
        let folder = folder.path();
        let ready_from = |scene: &Scene| {
            let probe = scene.probe.as_ref().unwrap();
            ready(&scene.room(probe), &rooms(Some(folder.to_owned())))
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
        let version = rooms(None).version;
        assert!(room_of_bytes(&postcard::to_stdvec(&(version, &odd)).unwrap(), &[]).is_none());

        // What the room depends on makes it another one.
        scene.probe.as_mut().unwrap().exposure *= 1.5;
        assert_eq!(ready_from(&scene).read_from, None);
        assert_eq!(fs::read_dir(folder).unwrap().count(), 2);
    }
}
