"""Structs of a MATLAB or HDF5 file of which each is a record of one layout."""

import numpy as np
import pytest
import scipy.io

from airtruth.errors import ConfigurationError, LogError
from airtruth.importers import (
    MappingFile,
    convert,
    find_manoeuvres,
    guess_mapping,
    import_log,
    open_source,
)
from airtruth.importers.guess import alike

T = np.arange(400) * 0.02
STATED = {
    "time": {"column": "time"},
    "channels": {
        "airspeed_m_s": {"column": "air.V", "unit": "m/s"},
        "q_rad_s": {"column": "q", "unit": "deg/s"},
    },
}


def record(number):
    return {"time": T, "q": np.sin(T + number), "air": {"V": 20.0 + number + 0.01 * T}}


def mapping(*structs, **further):
    return MappingFile.model_validate({**STATED, "source": {"structs": list(structs)}, **further})


@pytest.fixture
def flights(tmp_path):
    path = tmp_path / "flights.mat"
    array = np.empty(
        (1, 2), dtype=[(name, object) for name in record(1)]
    )  # a struct array; a list becomes cells
    for i in range(2):
        array[0, i] = tuple(record(3 + i).values())
    cells = np.array([[record(5), record(6)]], dtype=object)
    content = {"first": record(1), "second": record(2), "more": array, "cells": cells, "note": "of one day"}
    scipy.io.savemat(path, content)
    return path


def test_each_struct_becomes_a_run(flights):
    log = convert(open_source(flights), mapping("second", "first"))
    assert log.run_ids == ("second", "first")
    for run, number in enumerate((2, 1)):
        np.testing.assert_allclose(log.channels["q_rad_s"][log.rows(run)], np.radians(np.sin(T + number)))
        np.testing.assert_allclose(log.channels["airspeed_m_s"][log.rows(run)], 20.0 + number + 0.01 * T)


def test_structs_of_an_array_have_numbers(flights):
    source = open_source(flights)
    assert {"first", "first.air", "more(1)", "more(2).air", "cells(2)"} <= set(source.structs)
    log = convert(source, mapping("more(2)", "cells(1)"))
    assert log.run_ids == ("more(2)", "cells(1)")
    np.testing.assert_allclose(
        log.channels["airspeed_m_s"], 24.0 + np.arange(2).repeat(400) + 0.01 * np.tile(T, 2)
    )


def test_groups_of_an_hdf5_file_are_structs(tmp_path):
    h5py = pytest.importorskip("h5py")
    path = tmp_path / "flights.h5"
    with h5py.File(path, "w") as file:
        for number in (1, 2):
            for name, values in (("time", T), ("q", np.sin(T + number)), ("air/V", 20.0 + number + 0.01 * T)):
                file[f"day/run{number}/{name}"] = values
    log = convert(open_source(path), mapping("day.run1", "day.run2"))
    assert log.run_ids == ("day.run1", "day.run2")
    np.testing.assert_allclose(log.channels["airspeed_m_s"][log.rows(1)], 22.0 + 0.01 * T)


def test_a_struct_that_does_not_exist_is_named(flights):
    with pytest.raises(LogError, match="no struct 'frist'; did you mean 'first'"):
        convert(open_source(flights), mapping("frist"))
    flat = flights.with_name("flat.mat")
    scipy.io.savemat(flat, {"q": T})
    with pytest.raises(LogError, match="the file holds none, so leave structs out"):
        convert(open_source(flat), mapping("first"))


def test_one_division_into_runs(flights):
    cut = [{"run_id": "a", "start_s": 0.0, "end_s": 4.0}]
    with pytest.raises(ValueError, match=r"structs and .*manoeuvre.* both divide"):
        mapping("first", "second", manoeuvre=cut)
    assert convert(open_source(flights), mapping("first", manoeuvre=cut)).run_ids == ("a",)
    with pytest.raises(ValueError, match="'first' is given twice"):
        mapping("first", "first")
    with pytest.raises(ConfigurationError, match="structs names 2 records"):
        find_manoeuvres(flights, mapping("first", "second"))


def test_structs_of_several_files_keep_the_names_of_their_files(flights, tmp_path):
    other = tmp_path / "other.mat"
    scipy.io.savemat(other, {"first": record(7)})
    further = {"alpha_rad": "deg", "az_m_s2": "m/s2", "elevator_rad": "deg", "density_kg_m3": "kg_m3"}
    wider = {name: {"value": 1.0, "unit": unit} for name, unit in further.items()}
    log = import_log(
        [flights, other], mapping("first", channels={**STATED["channels"], **wider}), force=True
    ).log
    assert log.run_ids == ("flights:first", "other:first")


def flight(number):
    """Half of the flight of a small aircraft that is integrated in `validation.guess_flights`, at 50 Hz."""
    from validation.guess_flights import flown

    truth = flown("single")
    half = len(truth["t_s"]) // 2
    rows = slice(half * number, half * (number + 1), 8)
    c = {name: values[rows] for name, values in truth.items()}
    return {
        "time": c["t_s"] - c["t_s"][0],
        "V": c["airspeed_m_s"],
        "alpha": np.degrees(c["alpha_rad"]),
        "q": np.degrees(c["q_rad_s"]),
        "theta": np.degrees(c["theta_rad"]),
        "ax": c["ax_m_s2"],
        "az": c["az_m_s2"],
        "de": np.degrees(c["elevator_rad"]),
        "h_m": c["altitude_m"],
    }


def test_the_guess_proposes_structs_of_one_layout(tmp_path):
    path = tmp_path / "day.mat"
    scipy.io.savemat(path, {"run7": flight(0), "run9": flight(1), "day": 12.0})
    text = guess_mapping(path)
    assert 'structs = ["run7", "run9"] # each a run' in text
    (tmp_path / "m.toml").write_text(text)
    log = import_log(path, tmp_path / "m.toml").log
    assert log.run_ids == ("run7", "run9")
    assert set(log.channels) >= {
        "airspeed_m_s",
        "alpha_rad",
        "q_rad_s",
        "az_m_s2",
        "elevator_rad",
        "altitude_m",
    }


def test_instances_of_a_sensor_are_no_records(tmp_path):
    path = tmp_path / "log.mat"
    topic = {"time": T, "x": T, "y": T, "z": T}
    scipy.io.savemat(
        path, {"gyro0": topic, "gyro1": topic, "air": {"time": T, "V": T, "p": T, "h": T, "t": T}}
    )
    assert alike(open_source(path)) == ()
