"""The plan of the driver: Case 1 between the two FMUs, from their model descriptions."""

import re
import xml.etree.ElementTree as ElementTree

STOP, STEP = 30.0, 0.01

# Case 1 turns the controller on at 20 s; its first load step is brought forward from 50 s.
EVENTS = [(20.0, "controller", "enable", True), (25.0, "grid", "dP_load[12]", -0.5), (25.0, "grid", "dQ_load[12]", -0.5)]

WATCHED = {"controller": ["omega_set", "V_set", "P_set"], "grid": ["P", "Q", "V", "omega", "E", "bus_V"]}


class Described:
    """The variables of an unpacked FMU."""

    def __init__(self, folder):
        root = ElementTree.parse(folder / "modelDescription.xml").getroot()
        self.guid = root.get("guid")
        scalars = root.find("ModelVariables").findall("ScalarVariable")
        self.references = {one.get("name"): int(one.get("valueReference")) for one in scalars}
        self.causality = {one.get("name"): one.get("causality") for one in scalars}
        self.reals = {one.get("name") for one in scalars if one.find("Real") is not None}

    def array(self, quantity):
        """The elements of a quantity, in order."""
        pattern = re.compile(re.escape(quantity) + r"\[\d+\]$")
        found = [name for name in self.references if pattern.match(name)]
        assert found, quantity
        return found


def write(path, parts, libraries):
    """Writes the plan for the folders of the two unpacked FMUs (`parts`); gives back the names of the columns."""
    order = ["controller", "grid"]
    described = {name: Described(parts[name]) for name in order}
    lines, columns = [], ["time"]
    for name in order:
        resources = (parts[name] / "resources").as_uri()
        lines += [f"library {libraries[name]}", f"guid {described[name].guid}", f"resources {resources}"]
    for a, b in [(0, 1), (1, 0)]:
        source, sink = described[order[a]], described[order[b]]
        for name in sorted(source.reals & sink.reals):
            if source.causality[name] == "output" and sink.causality[name] == "input":
                lines.append(f"connect {a} {source.references[name]} {b} {sink.references[name]}")
    # Seven batteries: 4 setpoints and 5 measurements each.
    assert sum(line.startswith("connect") for line in lines) == 7 * 9
    for time, who, name, value in EVENTS:
        kind = "b" if value is True else "r"
        lines.append(f"event {time} {kind} {order.index(who)} {described[who].references[name]} {float(value)}")
    for index, who in enumerate(order):
        for quantity in WATCHED[who]:
            for name in described[who].array(quantity):
                lines.append(f"watch {index} {described[who].references[name]}")
                columns.append(f"{who}.{name}")
    lines.append(f"run {STOP} {STEP}")
    path.write_text("\n".join(lines) + "\n")
    return columns
