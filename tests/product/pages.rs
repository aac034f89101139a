//! Every page in a headless browser: nothing on its console, nothing loaded from elsewhere, nothing cut off
//! at 400 px, working points, tables and pictures, in light and dark mode. Skipped without a browser.

use std::fs;
use std::path::{Path, PathBuf};
use std::time::Duration;

use assert_cmd::Command;

use crate::common::{good, kinoise};

const BROWSERS: [&str; 4] =
    ["chromium", "chromium-browser", "google-chrome", "google-chrome-stable"];
const SCRIPT: &str = include_str!("pages.js");
const SLOW: &str = "GL Driver Message (OpenGL, Performance";

/// The first browser on the PATH; `None`, with a printed line, if there is none.
fn browser() -> Option<PathBuf> {
    let path = std::env::var_os("PATH").unwrap_or_default();
    let folders: Vec<PathBuf> = std::env::split_paths(&path).collect();
    let all = BROWSERS.iter().flat_map(|name| folders.iter().map(move |f| f.join(name)));
    let found = all.into_iter().find(|program| program.is_file());
    if found.is_none() {
        println!("skipped: no {} on the PATH to look at the pages with", BROWSERS.join(", "));
    }
    found
}

/// Faults that the browser finds in pages (name and text), and which pages it looked at.
fn looked_at(browser: &Path, pages: &[(String, String)], dark: bool) -> (Vec<String>, Vec<String>) {
    let folder = tempfile::tempdir().expect("a temporary folder");
    let json = serde_json::to_string(pages).expect("text").replace("</", "<\\/");
    let driver = format!(
        "<!DOCTYPE html><meta charset=utf-8><meta name=color-scheme content='light dark'><body>\
         <pre id=result></pre><script>const DARK = {dark}, PAGES = {json};</script><script>{SCRIPT}</script>"
    );
    let path = folder.path().join("driver.html");
    fs::write(&path, driver).expect("written");
    let scheme = u8::from(!dark);
    let output = Command::new(browser)
        .args(["--headless", "--no-sandbox", "--enable-unsafe-swiftshader", "--no-first-run"])
        .args(["--disable-background-networking", "--enable-logging=stderr", "--log-level=0"])
        .args(["--virtual-time-budget=60000", "--timeout=90000", "--dump-dom"])
        .arg(format!("--blink-settings=preferredColorScheme={scheme}"))
        .arg(format!("--user-data-dir={}", folder.path().join("profile").display()))
        .arg(format!("file://{}", path.display()))
        .timeout(Duration::from_secs(180))
        .output()
        .expect("the browser runs");
    let dom = String::from_utf8_lossy(&output.stdout);
    let result =
        dom.split_once("<pre id=\"result\">").and_then(|(_, rest)| rest.split_once("</pre>"));
    let result = result.map_or("", |(text, _)| text);
    let (seen, mut faults): (Vec<String>, Vec<String>) =
        result.lines().map(String::from).partition(|line| line.starts_with("looked at"));
    // Without a graphics card the browser copies each WebGL image and warns that this is slow.
    let said = |line: &&str| line.contains(":CONSOLE") && !line.contains(SLOW);
    let stderr = String::from_utf8_lossy(&output.stderr);
    faults.extend(stderr.lines().filter(said).map(String::from));
    (faults, seen)
}

#[track_caller]
fn run(folder: &Path, arguments: &[&str]) {
    let output = kinoise().current_dir(folder).args(arguments).output().expect("the program runs");
    let stderr = String::from_utf8_lossy(&output.stderr);
    assert!(output.status.code().is_some_and(|code| code < 2), "{arguments:?}: {stderr}");
}

/// A page of each kind, and those in KINOISE_PAGES, a list of files in the format of PATH.
fn pages(folder: &Path) -> Vec<(String, String)> {
    let recording = good().to_str().expect("a plain path");
    run(folder, &["calibrate", recording, "-o", "calibrated"]);
    fs::write(
        folder.join("table.csv"),
        "z_m,theta_rad,sigma_m,n\n1,0,.0014,90\n2,0,.0057,90\n3,0,.0128,90\n4,0,.023,90\n",
    )
    .expect("written");
    run(folder, &["fit", "table.csv", "--form", "khoshelham", "-o", "fitted"]);
    run(folder, &["diagnose", recording, "-o", "matched"]);
    let bowl = "radial-disparity-bias:k_px=1";
    run(folder, &["simulate", "bent", "--like", recording, "--effect", bowl]);
    run(folder, &["diagnose", "bent", "--model", "calibrated/model.json", "-o", "mismatched"]);
    run(folder, &["simulate", "film", "--room", "--frames", "40", "--shrink", "4"]);
    run(folder, &["map", "film", "-o", "mapped"]);
    run(folder, &["compare", "film", "-o", "compared"]);
    let [truth, estimate] = ["film/groundtruth.txt", "mapped/trajectory.txt"];
    run(folder, &["evaluate", "--truth", truth, "--estimate", estimate, "-o", "evaluated"]);
    let mut files: Vec<PathBuf> =
        ["calibrated", "fitted", "matched", "mismatched", "compared", "evaluated"]
            .map(|name| folder.join(name).join("report.html"))
            .into();
    files.push(folder.join("mapped/map.html"));
    let more = std::env::var_os("KINOISE_PAGES").unwrap_or_default();
    files.extend(std::env::split_paths(&more).filter(|path| path.is_file()));
    let read = |path: &PathBuf| {
        let page = fs::read_to_string(path).unwrap_or_else(|e| panic!("{}: {e}", path.display()));
        (path.display().to_string(), page)
    };
    files.iter().map(read).collect()
}

#[test]
fn every_page_is_clean_at_both_widths_in_light_and_dark() {
    let Some(browser) = browser() else { return };
    let folder = tempfile::tempdir().expect("a temporary folder");
    // Pages show the recording's path: one without break points must not widen them.
    let long = folder.path().join("recordings_of_a_single_long_word_".repeat(3));
    fs::create_dir(&long).expect("made");
    let pages = pages(&long);
    for dark in [false, true] {
        let (faults, seen) = looked_at(&browser, &pages, dark);
        assert!(faults.is_empty(), "dark: {dark}\n{}", faults.join("\n"));
        assert_eq!(seen.len(), 2 * pages.len(), "dark: {dark}\n{}", seen.join("\n"));
    }
}

/// The check itself finds faults.
#[test]
fn a_spoilt_page_is_told() {
    let Some(browser) = browser() else { return };
    let page = "<!DOCTYPE html><title>spoilt</title><body style='background: #fff'><main>\
        <h2>no link</h2><div style='width: 700px'>wide</div><div role=img></div>\
        <img src='http://127.0.0.1:9/none.png'><p>NaN</p>\
        <button class=zoom type=button></button><dialog></dialog></main>\
        <script>console.error('spoilt on purpose')</script>";
    let pages = [("spoilt".to_string(), page.to_string())];
    let (faults, seen) = looked_at(&browser, &pages, true);
    let faults = faults.join("\n");
    assert_eq!(seen.len(), 2, "{faults}");
    for says in [
        "at 400 px: 708 px wide",
        "the ground is 255",
        "no name",
        "no alt",
        "no link",
        "does not say: command",
        "NaN",
        "does not enlarge",
        "spoilt on purpose",
        "none.png",
    ] {
        assert!(faults.contains(says), "{says} is not told:\n{faults}");
    }
    assert!(!faults.contains("at 1280 px: 708 px wide"), "{faults}");
}
