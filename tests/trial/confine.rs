//! A process that can reach one set and nothing else.

use std::path::Path;

/// Shut this process, and every thread it will start, out of everything but reading below `read` and
/// writing below `write`; no network. Says what is in force, and only what a trial at the door
/// confirms. Call it before any thread is started: threads that run already stay free.
#[cfg(target_os = "linux")]
pub fn confine(read: &Path, write: &Path) -> String {
    use landlock::LandlockStatus::Available;
    match restrict(read, write) {
        Ok(status) => match status.landlock {
            Available { effective_abi, .. } if shut() => {
                format!("landlock ABI {}", effective_abi as i32)
            }
            _ => "not available on this kernel".into(),
        },
        Err(e) => format!("not in force: {e}"),
    }
}

/// Not known on this system.
#[cfg(not(target_os = "linux"))]
pub fn confine(_read: &Path, _write: &Path) -> String {
    "not available on this system".into()
}

#[cfg(target_os = "linux")]
fn restrict(
    read: &Path,
    write: &Path,
) -> Result<landlock::RestrictionStatus, landlock::RulesetError> {
    use landlock::{
        ABI, Access, AccessFs, AccessNet, CompatLevel, Compatible, Ruleset, RulesetAttr,
        RulesetCreatedAttr, Scope, path_beneath_rules,
    };
    // What an older kernel lacks is left out; `status` tells.
    let all = AccessFs::from_all(ABI::V5);
    let reading = AccessFs::ReadFile | AccessFs::ReadDir;
    Ruleset::default()
        .set_compatibility(CompatLevel::BestEffort)
        .handle_access(all)?
        .handle_access(AccessNet::from_all(ABI::V4))?
        .scope(Scope::from_all(ABI::V6))?
        .create()?
        .add_rules(path_beneath_rules([read], reading))?
        .add_rules(path_beneath_rules([write], all))?
        .restrict_self()
}

/// The root folder can be listed on every Linux, except from inside.
#[cfg(target_os = "linux")]
fn shut() -> bool {
    std::fs::read_dir("/").is_err()
}
