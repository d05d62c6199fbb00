//! Makes certificates, keys and configuration files for a roster.
//!
//! A certificate authority signs one certificate for each participant. Its key is never written, so no further certificate
//! can be issued. A changed roster needs new certificates for all.

use std::collections::BTreeSet;
use std::fs::Permissions;
use std::io::Write;
use std::os::unix::fs::{DirBuilderExt, OpenOptionsExt, PermissionsExt};
use std::path::{Path, PathBuf};
use std::time::{Duration, SystemTime};

use bus::check_key_file;
use bus::secure::{Credentials, client_config, simulator_config};
use protocol::access::{CONSOLE, RESERVED, SIMULATOR};
use protocol::keys::Keys;
use protocol::name::OPERATOR;
use protocol::{RobotName, RunName};
use rcgen::{
    BasicConstraints, CertificateParams, CertifiedIssuer, DnType, ExtendedKeyUsagePurpose, IsCa,
    KeyPair, KeyUsagePurpose,
};

use crate::error::LaunchError;

/// The certificate of the authority, in the folder itself.
const CA: &str = "ca.pem";
/// Files of each participant, in a folder of its own.
const CERTIFICATE: &str = "cert.pem";
const KEY: &str = "key.pem";
const CONFIG: &str = "zenoh.json5";
/// What is reported where a key or a certificate cannot be made.
const NO_CERTIFICATE: &str = "no certificate can be made";
/// Hosts in every simulator's certificate.
const LOCAL_HOSTS: [&str; 3] = ["localhost", "127.0.0.1", "::1"];
const DAY: Duration = Duration::from_secs(86_400);

/// The options of `cars secure init`.
#[derive(Debug)]
pub struct Certificates {
    /// The folder to make.
    pub folder: PathBuf,
    /// The robots that may take part.
    pub robots: Vec<RobotName>,
    /// Further names or addresses of the simulator's machine.
    pub hosts: Vec<String>,
    /// Validity of the certificates, days.
    pub days: u32,
    /// The only run that the access control admits; without it any run.
    pub run: Option<RunName>,
    /// Whether the files of an earlier call are replaced.
    pub replaces: bool,
}

impl Certificates {
    /// Makes all files. Returns the end of their validity as text.
    ///
    /// # Errors
    /// If a name is taken, the folder has other content, or a file cannot be written.
    pub fn make(&self) -> Result<String, LaunchError> {
        self.check_names()?;
        self.make_folder()?;
        self.make_files()
    }

    /// The configuration file of a participant: a robot, or the simulator.
    #[must_use]
    pub fn config_of(&self, name: &str) -> PathBuf {
        config_of(&self.folder, name)
    }

    /// Names of all participants but the simulator.
    pub fn clients(&self) -> impl Iterator<Item = &str> {
        self.robots
            .iter()
            .map(RobotName::as_str)
            .chain([OPERATOR, CONSOLE])
    }

    fn check_names(&self) -> Result<(), LaunchError> {
        // Each name is that of a folder, and some file systems ignore case.
        let mut taken: BTreeSet<String> = RESERVED.iter().map(|name| (*name).to_owned()).collect();
        taken.insert(CA.to_owned());

        for robot in &self.robots {
            if !taken.insert(robot.as_str().to_lowercase()) {
                let help = "each participant has a folder of its name, and some are not robots";
                let reason = format!("the name {robot} is taken already");
                return Err(LaunchError::refused_with_help(reason, help));
            }
        }
        Ok(())
    }

    /// Makes the folder, accessible only by its owner, and removes the files of an earlier call.
    fn make_folder(&self) -> Result<(), LaunchError> {
        let folder = &self.folder;
        let has_ca = folder.join(CA).exists();
        let is_ours = has_ca || folder.join(SIMULATOR).join(CONFIG).exists();
        let entries = folder.read_dir();
        let is_empty = !entries.is_ok_and(|mut entries| entries.next().is_some());
        let is_free = is_empty || (self.replaces && is_ours);
        if !is_free {
            let help = if is_ours {
                "--force makes new files; all earlier certificates are then useless"
            } else {
                "it has other content: choose another folder"
            };
            let reason = format!("{} is there already", folder.display());
            return Err(LaunchError::refused_with_help(reason, help));
        }

        make_private_folder(folder)?;
        remove_earlier(folder)
    }

    /// Makes all files. Returns the end of their validity as text.
    fn make_files(&self) -> Result<String, LaunchError> {
        let authority = Authority::new(self.days)?;
        let keys = self.run.as_ref().map_or_else(Keys::of_any_run, Keys::new);
        let mut hosts = LOCAL_HOSTS.map(str::to_owned).to_vec();
        hosts.extend(self.hosts.iter().cloned());

        authority.equip(&self.folder, SIMULATOR, hosts, |credentials| {
            simulator_config(&keys, &self.robots, credentials)
        })?;

        for name in self.clients() {
            authority.equip(&self.folder, name, Vec::new(), |credentials| {
                client_config(name, credentials)
            })?;
        }

        // The last file: a folder with it is complete.
        write_file(&self.folder.join(CA), &authority.issuer.pem(), 0o644)?;

        Ok(authority.validity)
    }
}

/// The certificate authority, which exists only in this process.
struct Authority {
    issuer: CertifiedIssuer<'static, KeyPair>,
    from: SystemTime,
    until: SystemTime,
    /// End of the validity as text.
    validity: String,
}

impl Authority {
    fn new(days: u32) -> Result<Self, LaunchError> {
        let now = SystemTime::now();
        // One hour ago, because the clocks of machines differ.
        let from = now - DAY / 24;
        let until = now + DAY * days;

        let mut params = named("CARS certificate authority", from, until);
        params.is_ca = IsCa::Ca(BasicConstraints::Constrained(0));
        params.key_usages = vec![KeyUsagePurpose::KeyCertSign];
        let validity = format!("{} (UTC)", params.not_after.date());
        let key = KeyPair::generate().map_err(LaunchError::system(NO_CERTIFICATE))?;
        let issuer = CertifiedIssuer::self_signed(params, key)
            .map_err(LaunchError::system(NO_CERTIFICATE))?;

        Ok(Self {
            issuer,
            from,
            until,
            validity,
        })
    }

    /// Makes the folder of a participant. Only a certificate with hosts is that of a server, so no other participant can act
    /// as the simulator.
    fn equip(
        &self,
        folder: &Path,
        name: &str,
        hosts: Vec<String>,
        config: impl FnOnce(&Credentials) -> String,
    ) -> Result<(), LaunchError> {
        let key = KeyPair::generate().map_err(LaunchError::system(NO_CERTIFICATE))?;
        let certificate = self
            .certificate(name, hosts, &key)
            .map_err(LaunchError::system(NO_CERTIFICATE))?;
        let key = key.serialize_pem();
        let config = config(&Credentials {
            ca: &self.issuer.pem(),
            certificate: &certificate,
            key: &key,
            validity: &self.validity,
        });

        let folder = folder.join(name);
        make_private_folder(&folder)?;
        write_file(&folder.join(CERTIFICATE), &certificate, 0o644)?;
        write_file(&folder.join(KEY), &key, 0o600)?;
        write_file(&folder.join(CONFIG), &config, 0o600)
    }

    /// A signed certificate, in PEM.
    fn certificate(
        &self,
        name: &str,
        hosts: Vec<String>,
        key: &KeyPair,
    ) -> Result<String, rcgen::Error> {
        let usage = if hosts.is_empty() {
            ExtendedKeyUsagePurpose::ClientAuth
        } else {
            ExtendedKeyUsagePurpose::ServerAuth
        };
        let with_hosts = CertificateParams::new(hosts)?;

        let mut params = named(name, self.from, self.until);
        params.subject_alt_names = with_hosts.subject_alt_names;
        params.key_usages = vec![KeyUsagePurpose::DigitalSignature];
        params.extended_key_usages = vec![usage];
        let certificate = params.signed_by(key, &self.issuer)?;
        Ok(certificate.pem())
    }
}

fn named(name: &str, from: SystemTime, until: SystemTime) -> CertificateParams {
    let mut params = CertificateParams::default();
    params.distinguished_name.push(DnType::CommonName, name);
    params.not_before = from.into();
    params.not_after = until.into();
    params
}

fn make_private_folder(folder: &Path) -> Result<(), LaunchError> {
    let made = std::fs::DirBuilder::new()
        .recursive(true)
        .mode(0o700)
        .create(folder);
    // An existing folder keeps its permissions, which may be wider.
    made.and_then(|()| std::fs::set_permissions(folder, Permissions::from_mode(0o700)))
        .map_err(LaunchError::path("make the folder", folder))
}

/// Writes a new file, which has its final permissions from the beginning.
fn write_file(path: &Path, text: &str, mode: u32) -> Result<(), LaunchError> {
    let file = std::fs::OpenOptions::new()
        .write(true)
        .create_new(true)
        .mode(mode)
        .open(path);
    file.and_then(|mut file| file.write_all(text.as_bytes()))
        .map_err(LaunchError::path("write", path))
}

/// Removes the files of an earlier call, and no other files.
fn remove_earlier(folder: &Path) -> Result<(), LaunchError> {
    let entries = folder.read_dir();
    let entries = entries.map_err(LaunchError::path("read the folder", folder))?;
    for entry in entries.flatten() {
        let participant = entry.path();
        if !participant.join(CONFIG).exists() {
            continue;
        }

        for name in [CERTIFICATE, KEY, CONFIG] {
            remove(&participant.join(name))?;
        }
        // A folder with other files stays.
        let _has_other_files = std::fs::remove_dir(&participant);
    }

    remove(&folder.join(CA))
}

/// Removes a file if it exists.
fn remove(file: &Path) -> Result<(), LaunchError> {
    if !file.exists() {
        return Ok(());
    }

    std::fs::remove_file(file).map_err(LaunchError::path("replace", file))
}

/// The configuration file of a participant in a folder of certificates.
fn config_of(folder: &Path, name: &str) -> PathBuf {
    folder.join(name).join(CONFIG)
}

/// A folder made by `cars secure init`.
#[derive(Debug, Clone)]
pub(crate) struct Secured {
    folder: PathBuf,
}

impl Secured {
    /// Opens the folder. It must have a configuration file for each of these participants, the simulator and the operator.
    pub(crate) fn find<'a>(
        folder: &Path,
        names: impl Iterator<Item = &'a str>,
    ) -> Result<Self, LaunchError> {
        let folder = std::path::absolute(folder).map_err(LaunchError::path("find", folder))?;
        let secured = Self { folder };

        for name in [SIMULATOR, OPERATOR].into_iter().chain(names) {
            let file = secured.config_of(name);
            if !file.is_file() {
                let help = "`cars secure init FOLDER --robots NAME,NAME…` makes one for each of its robots";
                let reason = format!("{name} has no certificate: there is no {}", file.display());
                return Err(LaunchError::refused_with_help(reason, help));
            }
            // The key by itself; each program checks its own configuration file.
            check_key_file(&secured.folder.join(name).join(KEY))?;
        }

        Ok(secured)
    }

    /// The configuration file of a participant.
    pub(crate) fn config_of(&self, name: &str) -> PathBuf {
        config_of(&self.folder, name)
    }

    /// Whether the access control admits a run with this name only.
    pub(crate) fn is_bound_to(&self, run: &RunName) -> bool {
        let config = std::fs::read_to_string(self.config_of(SIMULATOR)).unwrap_or_default();
        config.contains(&Keys::new(run).control())
    }

    /// The configuration file of the operator.
    pub(crate) fn operator(&self) -> PathBuf {
        self.config_of(OPERATOR)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn init(folder: &Path, robots: &[&str], force: bool) -> Result<(), LaunchError> {
        let certificates = Certificates {
            folder: folder.to_owned(),
            robots: robots
                .iter()
                .map(|name| RobotName::new(name).unwrap())
                .collect(),
            hosts: vec!["hall.example".to_owned(), "192.0.2.7".to_owned()],
            days: 30,
            run: None,
            replaces: force,
        };

        certificates.make().map(drop)
    }

    fn mode(path: &Path) -> u32 {
        std::fs::metadata(path).unwrap().permissions().mode() & 0o777
    }

    #[test]
    fn secrets_are_readable_by_their_owner_alone() {
        let lab = tempfile::tempdir().unwrap();
        let folder = lab.path().join("certificates");
        init(&folder, &["Butler", "Leguin"], false).unwrap();
        assert_eq!(mode(&folder), 0o700);

        for name in ["simulator", "operator", "console", "Butler", "Leguin"] {
            assert_eq!(mode(&folder.join(name)), 0o700, "{name}");
            for secret in [KEY, CONFIG] {
                assert_eq!(
                    mode(&folder.join(name).join(secret)),
                    0o600,
                    "{name}/{secret}"
                );
            }
            assert!(folder.join(name).join(CERTIFICATE).is_file());
        }

        let files = std::fs::read_dir(&folder).unwrap().count();
        assert_eq!(
            files, 6,
            "five participants and ca.pem: the key of the authority is not kept"
        );
    }

    #[test]
    fn nothing_is_overwritten_without_force() {
        let lab = tempfile::tempdir().unwrap();
        let folder = lab.path().join("certificates");
        init(&folder, &["Butler", "Vonda"], false).unwrap();
        let read = |name: &str| std::fs::read_to_string(folder.join(name)).unwrap();
        let before = read("Butler/key.pem");
        assert!(
            init(&folder, &["Butler"], false)
                .unwrap_err()
                .to_string()
                .contains("is there already")
        );
        assert_eq!(read("Butler/key.pem"), before);
        init(&folder, &["Butler", "Leguin"], true).unwrap();
        assert_ne!(read("Butler/key.pem"), before);
        assert!(
            !folder.join("Vonda").exists(),
            "the files of an earlier robot are removed"
        );

        let other = lab.path().join("other");
        std::fs::create_dir_all(&other).unwrap();
        std::fs::write(other.join("letter.txt"), "dear").unwrap();
        assert!(init(&other, &["Butler"], true).is_err());
        assert_eq!(std::fs::read_dir(&other).unwrap().count(), 1);
    }

    #[test]
    fn names_that_are_taken_are_refused() {
        let lab = tempfile::tempdir().unwrap();
        let folder = lab.path().join("certificates");

        for robots in [
            &["operator"][..],
            &["Simulator"],
            &["console"],
            &["A", "a"],
            &["ca.pem"],
        ] {
            assert!(
                init(&folder, robots, false)
                    .unwrap_err()
                    .to_string()
                    .contains("is taken"),
                "{robots:?}"
            );
        }

        assert!(!folder.exists());
    }

    #[test]
    fn a_secured_folder_has_a_configuration_for_each_participant() {
        let lab = tempfile::tempdir().unwrap();
        let folder = lab.path().join("certificates");
        init(&folder, &["Butler"], false).unwrap();
        let secured = Secured::find(&folder, ["Butler"].into_iter()).unwrap();
        assert!(secured.config_of("Butler").is_absolute() && secured.operator().is_file());
        let error = Secured::find(&folder, ["Butler", "Leguin"].into_iter())
            .unwrap_err()
            .to_string();
        assert!(error.contains("Leguin has no certificate"), "{error}");
    }
}
