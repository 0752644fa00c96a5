//! Pages: well-formed, by themselves, with the numbers of the JSON, and as a browser shows them.

use std::fs;
use std::path::Path;
use std::process::{Command, Output};

use ctiplan::mission::Mission;
use scraper::{ElementRef, Html, Selector};
use serde_json::Value;
use tempfile::TempDir;

const SNAP: &str = "missions/snap_l2.toml";
const SHIELDED: &str = "missions/snap_l2_shielded.toml";
const ONE_EPOCH: [&str; 2] = ["tests/practice/one-epoch/mission.toml", "tests/practice/one-epoch/trails.ecsv"];
const NOTCH: [&str; 2] = ["tests/practice/notch/mission.toml", "tests/practice/notch/trails.ecsv"];

fn ctiplan(arguments: &[&str]) -> Output {
    Command::new(env!("CARGO_BIN_EXE_ctiplan")).args(arguments).output().unwrap()
}

/// What a command makes: its page, its figures by themselves, its JSON.
struct Made {
    folder: TempDir,
    page: String,
    json: Value,
}

impl Made {
    fn by(arguments: &[&str]) -> Made {
        let folder = tempfile::tempdir().unwrap();
        let (html, plots) = (folder.path().join("page.html"), folder.path().join("plots"));
        let files = ["--html", html.to_str().unwrap(), "--plots", plots.to_str().unwrap(), "--json"];
        let output = ctiplan(&[arguments, &files].concat());
        let stderr = String::from_utf8(output.stderr).unwrap();
        assert!(output.status.success() && stderr.is_empty(), "{arguments:?}: {stderr}");
        let json = serde_json::from_slice(&output.stdout).unwrap();
        Made { page: fs::read_to_string(&html).unwrap(), json, folder }
    }

    /// The page as HTML, which it is without a fault.
    fn html(&self) -> Html {
        let html = Html::parse_document(&self.page);
        assert!(html.errors.is_empty(), "{:?}", html.errors);
        html
    }

    fn figures(&self) -> Vec<String> {
        let files = fs::read_dir(self.folder.path().join("plots")).unwrap();
        files.map(|file| fs::read_to_string(file.unwrap().path()).unwrap()).collect()
    }
}

fn all<'a>(html: &'a Html, selector: &str) -> Vec<ElementRef<'a>> {
    html.select(&Selector::parse(selector).unwrap()).collect()
}

fn text(element: ElementRef) -> String {
    element.text().collect()
}

/// Texts of all elements of a kind.
fn texts(html: &Html, selector: &str) -> Vec<String> {
    all(html, selector).into_iter().map(text).collect()
}

/// Laws of every page.
fn check(made: &Made, missions: &[&str]) {
    let html = made.html();
    // Nothing is fetched, nothing runs.
    for element in all(&html, "*") {
        let name = element.value().name();
        assert!(
            !["script", "link", "img", "image", "iframe", "object", "embed", "use", "base"].contains(&name),
            "{name}"
        );
        for (attribute, value) in element.value().attrs() {
            assert!(!["src", "href", "srcset", "xlink:href"].contains(&attribute), "{attribute}={value}");
            assert!(!attribute.starts_with("on") && !value.contains("url("), "{attribute}={value}");
        }
    }
    let style = texts(&html, "style").concat();
    assert!(!style.contains("url(") && !style.contains("@import"));
    // Whoever reads with their ears is told the language, the outline, and what figures show.
    assert_eq!(all(&html, "html[lang=en]").len(), 1);
    assert_eq!(all(&html, "h1").len(), 1);
    let levels: Vec<u8> =
        all(&html, "h1, h2, h3").iter().map(|heading| heading.value().name().as_bytes()[1] - b'0').collect();
    assert!(levels.windows(2).all(|pair| pair[1] <= pair[0] + 1), "{levels:?}");
    assert!(
        all(&html, "figure").iter().all(|figure| figure.value().attr("aria-label").is_some_and(|said| said.len() > 10))
    );
    let mut ids: Vec<&str> = all(&html, "[id]").iter().map(|element| element.value().attr("id").unwrap()).collect();
    ids.sort_unstable();
    assert!(ids.windows(2).all(|pair| pair[0] != pair[1]), "{ids:?}");
    // The figures are those of --plots.
    let figures = made.figures();
    assert!(!figures.is_empty() && figures.len() == all(&html, "figure > svg").len());
    assert!(figures.iter().all(|figure| made.page.contains(figure.as_str())));
    // What stands there as a mission is that mission.
    let resolved = texts(&html, "section > pre");
    let resolved = &resolved[resolved.len() - missions.len()..];
    for (text, path) in resolved.iter().zip(missions) {
        assert_eq!(Mission::parse(text).unwrap(), Mission::read(path).unwrap());
    }
    assert!(texts(&html, "footer")[0].contains(env!("CARGO_PKG_VERSION")));
    assert!(
        !all(&html, "td").is_empty() && texts(&html, "dd").iter().any(|source| source.contains("Rhodes et al. 2010"))
    );
    for row in all(&html, "tr") {
        let cells = |row: ElementRef| row.child_elements().count();
        let table =
            row.ancestors().filter_map(ElementRef::wrap).find(|element| element.value().name() == "table").unwrap();
        let head = table.select(&Selector::parse("thead tr").unwrap()).next().unwrap();
        assert_eq!(cells(row), cells(head));
    }
}

/// Whether a table has a number, as it is shown there (but for line breaks).
fn has(html: &Html, shown: &str) -> bool {
    texts(html, "td").iter().any(|cell| cell.split_whitespace().collect::<Vec<_>>().join(" ") == shown)
}

#[test]
fn the_page_of_an_evaluation() {
    let made = Made::by(&["evaluate", SNAP]);
    check(&made, &[SNAP]);
    let html = made.html();
    assert_eq!(texts(&html, "h1"), ["SNAP at L2"]);
    for year in made.json["years"].as_array().unwrap() {
        assert!(has(&html, &format!("{:.3e}", year["dose_mev_g"].as_f64().unwrap())));
        for galaxy in year["galaxies"].as_array().unwrap() {
            assert!(has(&html, &format!("{:+.3e}", galaxy["delta_e1"].as_f64().unwrap())), "{galaxy}");
        }
    }
    let exceeded = made.json["budget"]["uncorrected"]["date"].as_str().unwrap();
    assert!(texts(&html, ".verdict p").concat().contains(exceeded));
    // The day is in the figure, too.
    assert!(texts(&html, "svg text").iter().any(|text| text.contains(exceeded)));
}

#[test]
fn the_page_of_a_dose() {
    let made = Made::by(&["dose", SHIELDED]);
    check(&made, &[SHIELDED]);
    assert_eq!(made.page, Made::by(&["dose", SHIELDED]).page);
    let html = made.html();
    let total = format!("{:.4e} MeV/g", made.json["total_mev_g"].as_f64().unwrap());
    assert!(texts(&html, ".verdict p").concat().contains(&total));
    for (list, key) in [("years", "cumulative_mev_g"), ("depths", "sphere_mev_g"), ("confidences", "mission_mev_g")] {
        for row in made.json[list].as_array().unwrap() {
            assert!(has(&html, &format!("{:.3e}", row[key].as_f64().unwrap())), "{list}: {row}");
        }
    }
    for model in ["Xapsos", "PSTAR", "SR-NIEL"] {
        assert!(texts(&html, "dd").iter().any(|source| source.contains(model)), "{model}");
    }
}

#[test]
fn the_page_of_a_comparison() {
    let arguments =
        ["compare", SNAP, SHIELDED, "--transfers", "1650,825", "--set", "environment.model=constant,solar-cycle"];
    let made = Made::by(&arguments);
    check(&made, &[SNAP, SHIELDED]);
    let html = made.html();
    for scenario in made.json["scenarios"].as_array().unwrap() {
        assert!(has(&html, &format!("{:.3e}", scenario["delta_e"].as_f64().unwrap())), "{scenario}");
        let exceeded = &scenario["uncorrected"];
        let when = match (exceeded["date"].as_str(), exceeded["t_yr"].as_f64()) {
            (Some(date), Some(t_yr)) => format!("{date} {t_yr:.2} yr"),
            _ => "-".into(),
        };
        assert!(has(&html, &when), "{scenario}");
    }
    for reason in made.json["why"].as_array().unwrap() {
        assert!(texts(&html, ".verdict p").iter().any(|said| said == reason.as_str().unwrap()), "{reason}");
    }
}

#[test]
#[ignore = "slow: .ci/run runs it"]
fn the_pages_of_measurements() {
    let made = Made::by(&["validate", NOTCH[0], NOTCH[1]]);
    check(&made, &NOTCH[..1]);
    assert!(has(&made.html(), &format!("{:.1}", made.json["chi2"].as_f64().unwrap())));

    let made = Made::by(&["diagnose", ONE_EPOCH[0], ONE_EPOCH[1]]);
    check(&made, &ONE_EPOCH[..1]);
    let html = made.html();
    assert!(texts(&html, ".verdict p")[0].contains(made.json["verdict"].as_str().unwrap()));
    for rung in [&made.json["baseline"], &made.json["steps"][0]] {
        assert!(has(&html, &format!("{:.1}", rung["chi2"].as_f64().unwrap())), "{rung}");
    }
    // The source of what was found.
    let found = made.json["steps"][0]["effect"].as_str().unwrap();
    assert!(texts(&html, "dt").iter().any(|model| model.contains(&format!("Effect {found}"))), "{found}");
}

#[test]
fn the_page_of_a_study() {
    for study in ["launch", "shielding"] {
        let made = Made::by(&["study", study, SHIELDED]);
        check(&made, &[SHIELDED]);
        let said = texts(&made.html(), ".verdict p");
        let list = |key: &str| made.json[key].as_array().unwrap().iter().map(|one| one.as_str().unwrap().to_string());
        let warnings = list("warnings").map(|warning| format!("Warning: {warning}"));
        assert_eq!(said, list("findings").chain(warnings).collect::<Vec<_>>());
    }
}

#[test]
fn what_users_write_is_text() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("odd.toml");
    let odd = r#"</title><script>alert("&amp;")</script>'"#;
    let text = fs::read_to_string(SNAP).unwrap();
    let quoted = toml::Value::String(odd.into()).to_string();
    let text =
        text.replacen("\"SNAP at L2\"", &quoted, 1).replacen("\"disc\"", &quoted, 1).replacen("\"VV\"", &quoted, 1);
    fs::write(&path, text).unwrap();
    let path = path.to_str().unwrap();
    let made = Made::by(&["evaluate", path]);
    check(&made, &[path]);
    let html = made.html();
    assert_eq!(texts(&html, "h1"), [odd]);
    assert!(texts(&html, "th").iter().any(|head| head == odd));
    assert!(texts(&html, "svg text").iter().any(|label| label.trim() == odd));
    assert_eq!(all(&html, "script").len(), 0);
}

#[test]
fn a_file_that_cannot_be_written_is_refused_before_the_work() {
    let folder = tempfile::tempdir().unwrap();
    let (missing, taken) = (folder.path().join("missing/page.html"), folder.path().to_path_buf());
    for (path, problem) in [(missing, "the folder is not there"), (taken, "this is a folder, not a file")] {
        for arguments in [&["evaluate", SNAP][..], &["study", "launch", SNAP], &["diagnose", NOTCH[0], NOTCH[1]]] {
            let output = ctiplan(&[arguments, &["--html", path.to_str().unwrap()]].concat());
            assert_eq!((output.status.code(), output.stdout.len()), (Some(2), 0), "{arguments:?}");
            let stderr = String::from_utf8(output.stderr).unwrap();
            assert_eq!(stderr, format!("error: cannot write `{}`\n  {problem}\n", path.display()));
        }
    }
}

/// Measures a page where it is shown: what sticks out of the window, what labels are cut off, what figures are not seen.
const MEASURE: &str = r#"<script>
const faults = [];
if (document.documentElement.scrollWidth > innerWidth) faults.push("wider than the window");
for (const svg of document.querySelectorAll("svg")) {
  const frame = svg.getBoundingClientRect();
  if (frame.width < 300 || frame.height < 100) faults.push("a figure of " + frame.width + " px");
  for (const text of svg.querySelectorAll("text")) {
    const box = text.getBoundingClientRect();
    if (box.left < frame.left - 1 || box.right > frame.right + 1 || box.top < frame.top - 1 || box.bottom > frame.bottom + 1)
      faults.push("cut off: " + text.textContent.trim());
  }
}
document.body.dataset.faults = faults.join("; ");
document.body.dataset.figures = document.querySelectorAll("svg").length;
</script>"#;

/// What headless Chromium makes of a page; None where it is not installed.
fn chromium(profile: &Path, arguments: &[&str]) -> Option<Output> {
    let mut command = Command::new("chromium");
    command.args([
        "--headless",
        "--no-sandbox",
        "--disable-gpu",
        "--disable-quic",
        "--no-first-run",
        "--disable-background-networking",
        "--disable-component-update",
        "--disable-sync",
        "--host-resolver-rules=MAP * ~NOTFOUND",
        "--window-size=1000,1400",
    ]);
    command.arg(format!("--user-data-dir={}", profile.display())).args(arguments);
    match command.output() {
        Ok(output) => Some(output),
        Err(error) if error.kind() == std::io::ErrorKind::NotFound => None,
        Err(error) => panic!("{error}"),
    }
}

/// Skipped where Chromium is not installed (Debian and Ubuntu: chromium).
#[test]
fn a_browser_shows_the_pages() {
    for arguments in [
        &["evaluate", "missions/rhodes2010_galaxies.toml"][..],
        &["dose", SHIELDED],
        &["compare", SNAP, "--line-time-ms", "5..100:log:8", "--transfers", "400,1650"],
        &["validate", NOTCH[0], NOTCH[1]],
    ] {
        let made = Made::by(arguments);
        let folder = made.folder.path();
        let measured = folder.join("measured.html");
        fs::write(&measured, made.page.replace("</body>", &format!("{MEASURE}</body>"))).unwrap();
        let url = format!("file://{}", measured.display());
        let Some(shown) = chromium(&folder.join("profile"), &["--dump-dom", &url]) else {
            crate::skipped::for_want_of("Chromium");
            return;
        };
        let shown = Html::parse_document(&String::from_utf8(shown.stdout).unwrap());
        let body = all(&shown, "body")[0].value();
        assert_eq!(body.attr("data-faults"), Some(""), "{arguments:?}");
        assert_eq!(body.attr("data-figures").unwrap(), made.figures().len().to_string(), "{arguments:?}");

        let (picture, paper) = (folder.join("page.png"), folder.join("page.pdf"));
        let url = format!("file://{}", folder.join("page.html").display());
        for file in [format!("--screenshot={}", picture.display()), format!("--print-to-pdf={}", paper.display())] {
            chromium(&folder.join("profile"), &[&file, &url]).unwrap();
        }
        assert!(fs::read(&picture).unwrap().starts_with(b"\x89PNG"), "{arguments:?}");
        assert!(fs::read(&paper).unwrap().starts_with(b"%PDF"), "{arguments:?}");
    }
}
