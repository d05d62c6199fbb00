//! Certificates, keys and configuration files for a roster, made in one go.
//!
//! A certificate authority of its own signs one certificate for each participant and is forgotten: its key is never
//! written, so nobody can issue another certificate. A changed roster gets everything anew.

use std::collections::BTreeSet;
use std::io::Write;
use std::os::unix::fs::{DirBuilderExt, OpenOptionsExt, PermissionsExt};
use std::path::{Path, PathBuf};
use std::time::{Duration, SystemTime};

use bus::secure::{Credentials, client_config, simulator_config};
use miette::{IntoDiagnostic, WrapErr, miette};
use protocol::access::{CONSOLE, RESERVED, SIMULATOR};
use protocol::keys::Keys;
use protocol::name::OPERATOR;
use protocol::{RobotName, RunName};
use rcgen::{
    BasicConstraints, CertificateParams, CertifiedIssuer, DnType, ExtendedKeyUsagePurpose, IsCa,
    KeyPair, KeyUsagePurpose,
};

/// The certificate of the authority, in the folder itself.
const CA: &str = "ca.pem";
/// What each participant has in a folder of its own.
const CERTIFICATE: &str = "cert.pem";
const KEY: &str = "key.pem";
const CONFIG: &str = "zenoh.json5";
/// Hosts that every simulator's certificate names.
const LOCAL_HOSTS: [&str; 3] = ["localhost", "127.0.0.1", "::1"];
const DAY: Duration = Duration::from_secs(86_400);

/// What certificates are made for.
#[derive(Debug)]
pub struct Certificates {
    /// The folder to make.
    pub folder: PathBuf,
    /// The robots that may take part.
    pub robots: Vec<RobotName>,
    /// Further names or addresses by which the simulator's machine is reached.
    pub hosts: Vec<String>,
    /// How long the certificates are valid, days.
    pub days: u32,
    /// The one run that they are for; without it any run.
    pub run: Option<RunName>,
    /// Whether what an earlier call made there is replaced.
    pub replaces: bool,
}

impl Certificates {
    /// Makes what a secured run needs. Returns until when it is valid, in words.
    ///
    /// # Errors
    /// If a name is taken, if the folder holds something else, or if a file cannot be written.
    pub fn make(&self) -> miette::Result<String> {
        self.check_names()?;
        self.make_folder()?;
        self.make_files()
    }

    /// Names of all participants but the simulator.
    pub fn clients(&self) -> impl Iterator<Item = &str> {
        self.robots
            .iter()
            .map(RobotName::as_str)
            .chain([OPERATOR, CONSOLE])
    }

    fn check_names(&self) -> miette::Result<()> {
        // A folder is called after each, and some file systems do not tell `Butler` from `butler`.
        let mut taken: BTreeSet<String> = RESERVED.iter().map(|name| (*name).to_owned()).collect();
        taken.insert(CA.to_owned());

        match self
            .robots
            .iter()
            .find(|robot| !taken.insert(robot.as_str().to_lowercase()))
        {
            None => Ok(()),
            Some(robot) => {
                let help = "each participant has a folder called after it, and some are not robots";
                Err(miette!(help = help, "the name {robot} is taken already"))
            }
        }
    }

    /// Makes the folder, readable by its owner alone.
    fn make_folder(&self) -> miette::Result<()> {
        let folder = &self.folder;
        let is_ours = [folder.join(CA), folder.join(SIMULATOR).join(CONFIG)]
            .iter()
            .any(|file| file.exists());
        let is_empty = !folder
            .read_dir()
            .is_ok_and(|mut entries| entries.next().is_some());
        let is_free = is_empty || (self.replaces && is_ours);
        if !is_free {
            let help = if is_ours {
                "--force makes everything anew; what was made before is then of no use any more"
            } else {
                "it holds something else: choose another folder"
            };
            return Err(miette!(
                help = help,
                "{} is there already",
                folder.display()
            ));
        }

        make_private_folder(folder)?;

        forget_participants(folder)
    }

    /// Makes all files. Returns until when they are valid.
    fn make_files(&self) -> miette::Result<String> {
        let authority = Authority::new(self.days)?;
        let keys = self.run.as_ref().map_or_else(Keys::of_any_run, Keys::new);
        let hosts: Vec<String> = LOCAL_HOSTS
            .iter()
            .map(|host| (*host).to_owned())
            .chain(self.hosts.iter().cloned())
            .collect();

        authority.equip(&self.folder, SIMULATOR, hosts, |credentials| {
            simulator_config(&keys, &self.robots, credentials)
        })?;

        for name in self.clients() {
            authority.equip(&self.folder, name, Vec::new(), |credentials| {
                client_config(name, credentials)
            })?;
        }

        // Last: a folder with it is complete.
        write_file(&self.folder.join(CA), &authority.issuer.pem(), 0o644)?;

        Ok(authority.validity)
    }
}

/// Who signs certificates, as long as this process lives.
struct Authority {
    issuer: CertifiedIssuer<'static, KeyPair>,
    from: SystemTime,
    until: SystemTime,
    validity: String,
}

impl Authority {
    fn new(days: u32) -> miette::Result<Self> {
        let now = SystemTime::now();

        // Clocks of two machines differ by something.
        let (from, until) = (now - DAY / 24, now + DAY * days);
        let mut params = named("CARS certificate authority", from, until);
        params.is_ca = IsCa::Ca(BasicConstraints::Constrained(0));
        params.key_usages = vec![KeyUsagePurpose::KeyCertSign];
        let validity = format!("{} (UTC)", params.not_after.date());
        let key = KeyPair::generate().into_diagnostic()?;
        let issuer = CertifiedIssuer::self_signed(params, key).into_diagnostic()?;

        Ok(Self {
            issuer,
            from,
            until,
            validity,
        })
    }

    /// Makes the folder of a participant. One with hosts is a server, and one without a client: nobody but the
    /// simulator can pass for the simulator.
    fn equip(
        &self,
        folder: &Path,
        name: &str,
        hosts: Vec<String>,
        config: impl FnOnce(&Credentials) -> String,
    ) -> miette::Result<()> {
        let is_server = !hosts.is_empty();
        let mut params = named(name, self.from, self.until);
        params.subject_alt_names = CertificateParams::new(hosts)
            .into_diagnostic()?
            .subject_alt_names;
        params.key_usages = vec![KeyUsagePurpose::DigitalSignature];
        params.extended_key_usages = vec![if is_server {
            ExtendedKeyUsagePurpose::ServerAuth
        } else {
            ExtendedKeyUsagePurpose::ClientAuth
        }];
        let key = KeyPair::generate().into_diagnostic()?;
        let certificate = params.signed_by(&key, &self.issuer).into_diagnostic()?;
        let (ca, certificate, key) = (self.issuer.pem(), certificate.pem(), key.serialize_pem());
        let credentials = Credentials {
            ca: &ca,
            certificate: &certificate,
            key: &key,
            validity: &self.validity,
        };
        let folder = folder.join(name);
        make_private_folder(&folder)?;
        write_file(&folder.join(CERTIFICATE), &certificate, 0o644)?;
        write_file(&folder.join(KEY), &key, 0o600)?;

        write_file(&folder.join(CONFIG), &config(&credentials), 0o600)
    }
}

fn named(name: &str, from: SystemTime, until: SystemTime) -> CertificateParams {
    let mut params = CertificateParams::default();
    params.distinguished_name.push(DnType::CommonName, name);
    (params.not_before, params.not_after) = (from.into(), until.into());
    params
}

fn make_private_folder(folder: &Path) -> miette::Result<()> {
    let failed = || format!("cannot make the folder {}", folder.display());
    let made = std::fs::DirBuilder::new()
        .recursive(true)
        .mode(0o700)
        .create(folder);
    made.into_diagnostic().wrap_err_with(failed)?;
    // It may have been there, open to all.
    let closed = std::fs::set_permissions(folder, std::fs::Permissions::from_mode(0o700));
    closed.into_diagnostic().wrap_err_with(failed)
}

/// Writes a new file that at no moment more people can read than may.
fn write_file(path: &Path, text: &str, mode: u32) -> miette::Result<()> {
    let file = std::fs::OpenOptions::new()
        .write(true)
        .create_new(true)
        .mode(mode)
        .open(path);
    let written = file.and_then(|mut file| file.write_all(text.as_bytes()));
    written
        .into_diagnostic()
        .wrap_err_with(|| format!("cannot write {}", path.display()))
}

/// Removes what an earlier call made, and nothing else.
fn forget_participants(folder: &Path) -> miette::Result<()> {
    for entry in folder
        .read_dir()
        .into_diagnostic()?
        .flatten()
        .map(|entry| entry.path())
    {
        if !entry.join(CONFIG).exists() {
            continue;
        }
        for file in [CERTIFICATE, KEY, CONFIG]
            .map(|name| entry.join(name))
            .iter()
            .filter(|file| file.exists())
        {
            remove(file)?;
        }
        // Somebody may keep something of their own in it.
        let _kept = std::fs::remove_dir(&entry);
    }

    let ca = folder.join(CA);
    if ca.exists() { remove(&ca) } else { Ok(()) }
}

fn remove(file: &Path) -> miette::Result<()> {
    std::fs::remove_file(file)
        .into_diagnostic()
        .wrap_err_with(|| format!("cannot replace {}", file.display()))
}

/// A folder that `cars secure init` made, to be used.
#[derive(Debug, Clone)]
pub(crate) struct Secured {
    folder: PathBuf,
}

impl Secured {
    /// Finds the folder, which must have something for each of these participants, and for the simulator.
    pub(crate) fn find<'a>(
        folder: &Path,
        names: impl Iterator<Item = &'a str>,
    ) -> miette::Result<Self> {
        let folder = std::path::absolute(folder).into_diagnostic()?;
        let secured = Self { folder };
        let mut wanted = [SIMULATOR, OPERATOR].into_iter().chain(names);
        match wanted.find(|name| !secured.config_of(name).is_file()) {
            None => Ok(secured),
            Some(name) => {
                let help = "`cars secure init FOLDER --robots NAME,NAME…` makes one for every robot it names";
                let file = secured.config_of(name);
                Err(miette!(
                    help = help,
                    "{name} has no certificate: there is no {}",
                    file.display()
                ))
            }
        }
    }

    /// The configuration file of a participant.
    pub(crate) fn config_of(&self, name: &str) -> PathBuf {
        self.folder.join(name).join(CONFIG)
    }

    /// That of who started the run.
    pub(crate) fn operator(&self) -> PathBuf {
        self.config_of(OPERATOR)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn init(folder: &Path, robots: &[&str], force: bool) -> miette::Result<()> {
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
    fn nothing_is_overwritten_unless_it_is_meant() {
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
            "what is of no use any more is gone"
        );

        let other = lab.path().join("other");
        std::fs::create_dir_all(&other).unwrap();
        std::fs::write(other.join("letter.txt"), "dear").unwrap();
        assert!(init(&other, &["Butler"], true).is_err());
        assert_eq!(std::fs::read_dir(&other).unwrap().count(), 1);
    }

    #[test]
    fn names_that_would_pass_for_others_are_refused() {
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
    fn a_secured_folder_has_something_for_everybody() {
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
