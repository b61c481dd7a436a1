"""Every kind of bad input: one message that names the way out, exit code 2, nothing written."""

import os
from pathlib import Path

import numpy as np
import pytest

from tests.cli.conftest import LEG, Excited
from tests.conftest import Told
from wbc.cli import main
from wbc.measurement import save_log

BAD = [
    # logs
    ("compare nowhere.csv LEG", "no log at 'nowhere.csv'"),
    ("compare folder LEG", "is a folder"),
    ("compare degrees.csv LEG", "in degrees?"),
    ("compare other.csv LEG", "no position of hip, knee"),
    ("compare motor.csv LEG", "after the reduction as hip.rotor_torque and knee.rotor_torque"),
    ("diagnose motor.csv LEG", 'side = "motor"'),
    ("compare torn.csv LEG", "samples are missing in 10 places"),
    ("compare good.csv floating.csv LEG", "not logs of the same robot"),
    ("check header.csv LEG", "no rows"),
    # robots, effects, maps
    ("compare good.csv --robot planar_lag", "Did you mean 'planar_leg'?"),
    ("compare good.csv --robot wrong.toml", "Unknown key"),
    ("compare good.csv --robot anymal", "no position of LF_HAA"),
    ("compare good.csv LEG --columns nomap.toml", "No such file"),
    ("compare good.csv LEG --columns good.csv", "column map"),
    ("compare good.csv LEG --columns typo.toml", "Did you mean 'hip.position'?"),
    ("diagnose good.csv LEG --add colomb_friction", "coulomb_friction"),
    ("diagnose good.csv LEG --budget -1", "give a time > 0"),
    ("diagnose good.csv LEG --budget nan", "give a time > 0"),
    # what would be written
    ("compare good.csv LEG --json file/x.json", "'file' is a file"),
    ("compare good.csv LEG --report report.txt", "must end in .html"),
    ("compare good.csv LEG --report file/x.html", "'file' is a file"),
    ("diagnose good.csv LEG --save x.txt", "must end in .toml"),
    ("diagnose good.csv --robot wrong.toml --save wrong.toml", "would overwrite the input"),
    ("diagnose good.csv LEG --save a.toml --json a.toml", "what --save writes"),
    ("play good.csv --robot planar_leg_fixed --html file/x.html", "'file' is a file"),
    ("play good.csv --robot talos --html x.html", "no position of any joint of 'talos'"),
    ("play good.csv --robot planar_leg_fixed --ghost no.toml --html x.html", "no.toml"),
    ("play good.csv --robot planar_leg --ghost planar_leg_fixed --html x.html", "other joints"),
    ("metrics planar_leg --pose nowhere", "There are: paper"),
    ("metrics planar_leg --contact hand", "foot"),
    ("metrics planar_leg --axes ab", "some of x, y, z"),
    ("metrics planar_leg --figures file/out", "'file' is a file"),
    ("list robots --json folder", "is a folder"),
    ("design planar_leg --sweep reduction=6:160 --objective speed:max", "Unknown objective"),
    ("design planar_leg --sweep reduction=6:160 --objective lift:more", "lift:max or lift:min"),
    ("design planar_leg --sweep reduction=6:160 --sweep reduction=6:9", "swept twice"),
    ("design planar_leg --sweep reduction=6:160 --load -5", "the load must be >= 0"),
]


@pytest.fixture(scope="module")
def room(excited_log: Excited, tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Return a folder with a good log and many bad ones."""
    folder = tmp_path_factory.mktemp("room")
    log = excited_log(duration=3.0)
    save_log(log, folder / "good.csv")
    lines = (folder / "good.csv").read_text().splitlines()

    def write(name: str, rows: list[str]) -> None:
        (folder / name).write_text("\n".join(rows) + "\n")

    write("header.csv", lines[:1])
    write("other.csv", [lines[0].replace("hip", "shoulder").replace("knee", "elbow"), *lines[1:]])
    write("typo.toml", ["[columns]", '"hip.postion" = "x"'])
    write("wrong.toml", ["x = 1"])
    write("torn.csv", [line for k, line in enumerate(lines) if k % 75 < 50])
    torques = {f"{joint}.rotor_torque" for joint in ("hip", "knee")}
    after = {name: 20.0 * log.column(name) for name in torques}
    save_log(log.with_columns(after), folder / "motor.csv")
    turned = {"hip.position": np.degrees(log.column("hip.position"))}
    save_log(log.with_columns(turned), folder / "degrees.csv")
    save_log(log.with_columns({"base_x.position": log.time}), folder / "floating.csv")
    (folder / "file").touch()
    (folder / "folder").mkdir()
    return folder


@pytest.mark.parametrize(("command", "says"), BAD)
def test_bad_input_exits_with_two_names_the_way_out_and_writes_nothing(
    command: str, says: str, room: Path, monkeypatch: pytest.MonkeyPatch, told: Told
) -> None:
    monkeypatch.chdir(room)
    before = {path: path.stat().st_mtime_ns for path in room.rglob("*")}
    said = told(*command.replace("LEG", " ".join(LEG)).split(), code=2)
    assert says in said
    assert said.startswith("wbc: ")  # and nothing before it on the standard output
    assert "Traceback" not in said
    assert {path: path.stat().st_mtime_ns for path in room.rglob("*")} == before


def test_a_place_without_permission_is_refused_before_the_work(
    room: Path, tmp_path: Path, told: Told
) -> None:
    if os.geteuid() == 0:
        pytest.skip("root may write everywhere")
    tmp_path.chmod(0o500)
    said = told("compare", room / "good.csv", *LEG, "--json", tmp_path / "x.json", code=2)
    assert "no permission" in said


def test_a_disk_that_fails_in_the_middle_is_told_without_a_traceback(
    room: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, told: Told
) -> None:
    target, rename = tmp_path / "x.json", os.replace

    def full(source: str, path: str) -> None:
        if str(path) == str(target):  # compiled functions are still kept
            raise OSError(28, "No space left on device")
        rename(source, path)

    monkeypatch.setattr(os, "replace", full)
    said = told("compare", room / "good.csv", *LEG, "--json", target, code=2)
    assert f"'{target}': No space left on device" in said
    assert list(tmp_path.iterdir()) == []


def test_an_unknown_option_shows_the_usage_of_its_command(
    capsys: pytest.CaptureFixture[str],
) -> None:
    with pytest.raises(SystemExit) as end:
        main(["check", "run.csv", "--robot", "planar_leg", "--fixx", "map.toml"])
    said = capsys.readouterr().err
    assert end.value.code == 2
    assert "usage: wbc check" in said
    assert "--fix MAP.toml" in said
    assert "unrecognized arguments: --fixx map.toml" in said
