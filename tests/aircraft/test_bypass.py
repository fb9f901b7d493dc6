"""A fly-by-wire that no property switches off is bypassed in a copy of the model."""

import xml.etree.ElementTree as ET

from airtruth.aircraft.jsbsim.bypass import CHANNEL, bypass

MODEL = """<fdm_config><flight_control name="f"><channel name="Pitch"><integrator name="fcs/integral">
<input>velocities/q-rad_sec</input><output>fcs/elevator-pos-rad</output></integrator></channel></flight_control></fdm_config>"""


def test_the_bypass_is_behind_all_channels_and_writes_each_surface():
    root = ET.fromstring(MODEL)
    bypass(root, "fcs/elevator-cmd-norm", "fcs/elevator-pos-rad", 0.4, ["fcs/tvc-pos-rad"])
    last = root.findall("./flight_control/channel")[-1]
    assert last.get("name") == CHANNEL
    written = {c.findtext("output"): (c.findtext("input"), float(c.findtext("gain"))) for c in last}
    assert written == {
        "fcs/elevator-pos-rad": ("fcs/elevator-cmd-norm", 0.4),
        "fcs/tvc-pos-rad": ("fcs/elevator-cmd-norm", 0.0),
    }
