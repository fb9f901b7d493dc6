"""Bad mappings and files: one clear error that says what, where, what is allowed and what next."""

import numpy as np
import pytest
import scipy.io
from import_flight import mapping_by_name, write_csv

from airtruth.errors import AirtruthError, ConfigurationError, LogError, StoreError
from airtruth.importers import guess_mapping, import_log, read_mapping

N = 60


def columns(**changes):
    """Level flight with a slow pitch oscillation in the columns of `mapping_by_name`."""
    t = np.arange(N) / 50.0
    base = {
        "Clock [ms]": t * 1000.0,
        "KTAS": 80.0 + 0.0 * t,
        "AOA_nose": 5.0 + np.sin(t),
        "PitchAtt": 5.0 + np.sin(t),
        "PitchRate": np.cos(t),
        "Ax": 0.0 * t,
        "Nz": 1.0 + 0.0 * t,
        "ELEV_L": np.sin(2.0 * t),
        "ELEV_R": np.sin(2.0 * t),
        "Hp": 7000.0 + 0.0 * t,
        "rho": 0.0019269 + 0.0 * t,
    }
    return {**base, **changes}


def attempt(folder, mapping=None, table=None, force=True):
    write_csv(folder / "f.csv", table or columns())
    (folder / "map.toml").write_text(mapping or mapping_by_name())
    return import_log(folder / "f.csv", folder / "map.toml", force=force)


def message(error, folder, **given):
    with pytest.raises(error) as caught:
        attempt(folder, **given)
    assert caught.value.exit_code == 2
    return str(caught.value)


def test_the_base_is_good(tmp_path):
    assert attempt(tmp_path).log.run_ids == ("flight",)


@pytest.mark.parametrize(
    ("old", "new", "parts"),
    [
        ('"KTAS"', '"KIAS"', ["no column 'KIAS'", "did you mean 'KTAS'"]),
        ('"KTAS"', "40", ["no column 40", "the file has 11"]),
        ('unit = "kt"', 'unit = "rad"', ["airspeed_m_s", "a unit of angle", "m_s, kt, ft_s, km_h"]),
        ('unit = "kt"', 'unit = "mach"', ["'mach' is not a known unit", "km_h"]),
        ('unit = "kt"\n', "", ["channels.airspeed_m_s.unit", "required"]),
        (
            "[channels.alpha_rad]",
            "[channels.alfa_rad]",
            ["'alfa_rad' is not a channel", "did you mean 'alpha_rad'"],
        ),
        ("sign = -1", "sign = 2", ["channels.az_m_s2.sign", "got 2"]),
        ('column = "KTAS"', 'colum = "KTAS"', ["channels.airspeed_m_s.colum", "did you mean 'column'"]),
        ('column = "KTAS"', 'column = "KTAS"\nvalue = 3', ["one of column, columns or value"]),
        ('column = "KTAS"', "column = 0", ["counted from 1"]),
        ('unit = "ms"', 'unit = "hours"', ["'hours'", "s, ms, us"]),
        ('run_id = "flight"', 'run_id = "flight"\nschema = 2', ["schema", "got 2"]),
        ('run_id = "flight"', "run_id = ", ["not valid TOML"]),
        (
            'run_id = "flight"',
            'manoeuvre = [{ run_id = "a", start_s = 5, end_s = 2 }]',
            ["end_s 2 is not after start_s 5"],
        ),
        (
            'run_id = "flight"',
            'constants = { mass_kg = { value = 3, unit = "ft" }, weight = { value = 3, unit = "kg" } }',
            ["mass_kg", "a unit of length", "'weight' is not a constant", "mass_kg"],
        ),
        (
            'run_id = "flight"',
            'constants = { mass_kg = { value = 0, unit = "kg" } }',
            ["constants.mass_kg.value", "greater than 0 (got 0)"],
        ),
    ],
)
def test_a_mapping_that_cannot_be_used(old, new, parts, tmp_path):
    text = mapping_by_name()
    assert old in text
    found = message((ConfigurationError, LogError), tmp_path, mapping=text.replace(old, new, 1))
    for part in parts:
        assert part in found
    assert "map.toml" in found or "f.csv" in found


def test_every_problem_of_a_mapping_is_said_at_once(tmp_path):
    text = mapping_by_name().replace('unit = "kt"', 'unit = "x"').replace('column = "Ax"', "clumn = 3")
    found = message(ConfigurationError, tmp_path, mapping=text)
    assert "channels.ax_m_s2.clumn" in found
    (tmp_path / "m.toml").write_text(
        mapping_by_name().replace('unit = "kt"', 'unit = "x"').replace('"g"', '"y"')
    )
    with pytest.raises(ConfigurationError, match=r"airspeed_m_s: unit 'x'.*az_m_s2: unit 'y'"):
        read_mapping(tmp_path / "m.toml")


def test_a_manoeuvre_outside_the_file(tmp_path):
    text = mapping_by_name().replace(
        'run_id = "flight"', 'manoeuvre = [{ run_id = "a", start_s = 5, end_s = 9 }]'
    )
    assert "clock runs from 0 to 1.18 s" in message(LogError, tmp_path, mapping=text)


def test_two_divisions_into_runs(tmp_path):
    text = mapping_by_name().replace(
        'run_id = "flight"', 'manoeuvre = [{ run_id = "a", start_s = 0, end_s = 1 }]'
    )
    text = text.replace('unit = "ms"', 'unit = "ms"\nrun = "F"', 1)
    assert "both divide the file" in message(ConfigurationError, tmp_path, mapping=text)


def test_time_that_goes_back(tmp_path):
    t = np.arange(N) * 20.0
    t[[30, 31]] = t[[31, 30]]
    found = message(LogError, tmp_path, table=columns(**{"Clock [ms]": t}))
    assert "time does not increase in 1 rows, the first is row 32: 0.62 s, then 0.6 s" in found
    assert "sort the file" in found


def test_a_time_that_is_missing(tmp_path):
    t = np.arange(N) * 20.0
    t[7] = np.nan
    assert "in row 8 is empty or NaN" in message(LogError, tmp_path, table=columns(**{"Clock [ms]": t}))


def test_a_gap_is_refused_by_the_contract(tmp_path):
    t = np.arange(N) * 20.0
    t[40:] += 500.0
    assert "1 gap" in message(LogError, tmp_path, table=columns(**{"Clock [ms]": t}))


def test_rates_that_are_mixed(tmp_path):
    table = columns()
    table["AOA_nose"] = np.where(np.arange(N) % 5 == 0, table["AOA_nose"], np.nan)
    found = message(LogError, tmp_path, table=table)
    assert (
        "alpha_rad is empty, NaN or infinite in 48 of 60 rows, the first at 0.02 s; state [resample]" in found
    )


def test_clocks_that_differ_without_resampling(tmp_path):
    text = mapping_by_name().replace(
        "offset = -1.5\n", 'offset = -1.5\nclock = { column = "Clock [ms]", unit = "ms" }\n'
    )
    assert "state [resample] rate_hz and method (linear, cubic, previous)" in message(
        ConfigurationError, tmp_path, mapping=text
    )


def test_text_among_numbers(tmp_path):
    write_csv(tmp_path / "f.csv", columns())
    lines = (tmp_path / "f.csv").read_text().splitlines()
    cells = lines[11].split(",")
    cells[4] = "n/v"
    lines[11] = ",".join(cells)
    (tmp_path / "f.csv").write_text("\n".join(lines))
    (tmp_path / "map.toml").write_text(mapping_by_name())
    with pytest.raises(LogError, match=r"column 'PitchRate', line 12: 'n/v' is not a number"):
        import_log(tmp_path / "f.csv", tmp_path / "map.toml")


@pytest.mark.parametrize(
    ("content", "part"),
    [
        (b"", "the file is empty"),
        (b"# a comment\n\n", "holds no rows"),
        (b"a,b,c\n", "a header and no rows"),
        (b"a,b\n1,2\n1,2,3\n", "is not a table"),
        (b"\xff\xfe\x00 no text", "is not text in UTF-8"),
    ],
)
def test_text_files_without_a_table(content, part, tmp_path):
    (tmp_path / "f.csv").write_bytes(content)
    with pytest.raises(StoreError, match=part):
        guess_mapping(tmp_path / "f.csv")


def test_a_missing_file_and_an_unknown_suffix(tmp_path):
    with pytest.raises(StoreError, match="no such file"):
        guess_mapping(tmp_path / "none.csv")
    (tmp_path / "f.xyz").write_text("1")
    with pytest.raises(ConfigurationError, match="one of csv, table, mat, parquet, ulg"):
        guess_mapping(tmp_path / "f.xyz")
    (tmp_path / "f.ulg").write_bytes(b"not a log" * 20)
    with pytest.raises(StoreError, match="is not a PX4 log"):
        guess_mapping(tmp_path / "f.ulg")
    (tmp_path / "f.parquet").write_bytes(b"PAR1 and nothing")
    with pytest.raises(StoreError, match="truncated or damaged"):
        guess_mapping(tmp_path / "f.parquet")


@pytest.mark.parametrize("kept", [0.02, 0.3, 0.7, 0.95])
@pytest.mark.parametrize("compressed", [False, True])
def test_a_truncated_mat_file(kept, compressed, tmp_path):
    scipy.io.savemat(
        tmp_path / "f.mat", {"a": np.random.default_rng(0).normal(size=(80, 9))}, do_compression=compressed
    )
    data = (tmp_path / "f.mat").read_bytes()
    (tmp_path / "f.mat").write_bytes(data[: int(kept * len(data))])
    with pytest.raises(StoreError, match=r"truncated|holds no numeric array"):
        guess_mapping(tmp_path / "f.mat")


@pytest.mark.parametrize("kept", [0.1, 0.6, 0.95])
def test_a_truncated_mat_file_of_version_7_3(kept, tmp_path):
    h5py = pytest.importorskip("h5py")
    with h5py.File(tmp_path / "f.mat", "w") as file:
        file.create_dataset("a", data=np.random.default_rng(0).normal(size=(9, 800)))
    data = (tmp_path / "f.mat").read_bytes()
    (tmp_path / "f.mat").write_bytes(data[: int(kept * len(data))])
    with pytest.raises(StoreError, match="truncated"):
        guess_mapping(tmp_path / "f.mat")


def test_columns_of_matrices(tmp_path):
    scipy.io.savemat(tmp_path / "f.mat", {"data": np.zeros((80, 4)), "text": "abc"})
    for entry, part in [
        ('column = "data"', 'is a matrix of 80 x 4; state variable = "data"'),
        ("column = 2", "of which matrix"),
        ('column = 5\nvariable = "data"', "no column 5 in 'data', which has 4"),
        ('column = "q"\nvariable = "data"', "only numbers 1 to 4"),
        ('column = 1\nvariable = "dat"', "did you mean 'data'"),
    ]:
        (tmp_path / "m.toml").write_text(
            f'[time]\nrate_hz = 50\n[channels.alpha_rad]\nunit = "deg"\n{entry}\n'
        )
        with pytest.raises(AirtruthError) as caught:
            import_log(tmp_path / "f.mat", tmp_path / "m.toml")
        assert part in str(caught.value)


def test_a_file_without_times(tmp_path):
    text = mapping_by_name().replace('[time]\ncolumn = "Clock [ms]"\nunit = "ms"', "[time]")
    assert "state [time] column (and unit), or rate_hz" in message(ConfigurationError, tmp_path, mapping=text)


def test_the_contract_is_not_waived_by_force(tmp_path):
    text = mapping_by_name()
    start = text.index("[channels.q_rad_s]")
    text = text[:start] + text[text.index("[channels.ax_m_s2]") :]
    assert "q_rad_s: required channel is missing" in message(LogError, tmp_path, mapping=text)


@pytest.mark.parametrize(
    ("old", "new", "words"),
    [
        ("run_id", "schema = true\nrun_id", "schema: write 1 (got True)"),
        ("sign = -1", "sign = true", "sign: write -1 or 1 (got True)"),
        ('column = "Ax"', "column = true", "column: write a number or a name (got True)"),
        ('columns = ["ELEV_L"', "columns = [true", "columns: write a number or a name (got [True"),
        ("[source]", "[source]\nheader = 1", "source.header: write true or false (got 1)"),
    ],
)
def test_true_is_no_number(tmp_path, old, new, words):
    assert old in mapping_by_name()
    assert words in message(ConfigurationError, tmp_path, mapping=mapping_by_name().replace(old, new, 1))


def test_the_name_of_a_run_is_utf8(tmp_path):
    (tmp_path / "map.toml").write_text(mapping_by_name().replace('run_id = "flight"\n', ""))
    file = tmp_path / "gr\udcf6\udcdfe.csv"
    write_csv(file, columns())
    for files in (file, [file, file]):
        with pytest.raises(
            LogError, match=r"is not UTF-8, .* state run_id in the mapping, or rename the file"
        ):
            import_log(files, tmp_path / "map.toml", force=True)
    (tmp_path / "map.toml").write_text(mapping_by_name())
    assert import_log(file, tmp_path / "map.toml", force=True).log.run_ids == ("flight",)
