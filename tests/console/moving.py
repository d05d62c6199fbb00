"""One moving picture (SVG with SMIL) of several pictures of the console's plan, a tick each.

Elements that are alike in successive pictures are one element whose numbers and colors change; others are shown while they are
there. The places of robots and guests change smoothly, everything else at once.
"""

import difflib
import re
from xml.etree import ElementTree

SVG = "http://www.w3.org/2000/svg"
TICK_S = 0.4  # of the picture, for one tick
HELD = 6  # how many ticks the last picture stays
NUMBER = re.compile(r"-?\d+(?:\.\d+)?(?:e-?\d+)?")
PLACES = {"d", "x", "y", "width", "height"}
COLORS = {"fill", "stroke"}
# A disc: from its right side over its left one and back.
DISC = re.compile(rf"M(\S+) (\S+)L\S+ \S+?A(\S+) \S+ 0 0 1 (\S+) {NUMBER.pattern}A\S+ \S+ 0 0 1 \S+ {NUMBER.pattern}")
MANY = 20  # discs in one path: guests
STEP = 4  # of whose places every fourth is enough: a guest walks straight for seconds


def tag(element):
    return element.tag.removeprefix(f"{{{SVG}}}")


def rounded(text):
    return NUMBER.sub(lambda number: f"{float(number.group()):.1f}".removesuffix(".0"), text)


def kind(element):
    """What an element is, without its place and its color."""
    fixed = [(name, value) for name, value in sorted(element.items()) if name not in PLACES | COLORS]
    shape = NUMBER.sub("#", element.get("d", ""))
    paints = sorted(COLORS.intersection(element.keys()))
    return tag(element), tuple(fixed), shape, tuple(paints), (element.text or "").strip()


def keys(elements):
    """The kind of each element, and how many of this kind came before it."""
    seen = {}
    found = []
    for element in elements:
        kind_of = kind(element)
        seen[kind_of] = seen.get(kind_of, -1) + 1
        found.append((kind_of, seen[kind_of]))
    return found


def order(sequences):
    """All keys of the sequences, each before what it is drawn before."""
    merged = []
    for sequence in sequences:
        new = []
        for what, a, b, c, d in difflib.SequenceMatcher(None, merged, sequence, autojunk=False).get_opcodes():
            new += merged[a:b]
            if what != "equal":
                new += [key for key in sequence[c:d] if key not in merged]
        merged = new
    return list(dict.fromkeys(merged))


def animate(element, name, values, is_smooth):
    """Adds an animation of an attribute, unless it keeps its value."""
    if len(set(values)) == 1:
        return
    values = [*values, *[values[-1]] * HELD]
    attributes = {"attributeName": name, "dur": f"{len(values) * TICK_S:g}s", "repeatCount": "indefinite"}
    if is_smooth:
        attributes["values"] = ";".join(values)
    else:
        # A value counts from its time on: only changes are written.
        changes = [i for i, value in enumerate(values) if i == 0 or value != values[i - 1]]
        attributes["calcMode"] = "discrete"
        attributes["values"] = ";".join(values[i] for i in changes)
        attributes["keyTimes"] = ";".join(f"{i / len(values):.4g}" for i in changes)
    ElementTree.SubElement(element, f"{{{SVG}}}animate", attributes)


def leaf(found, is_smooth):
    """One element for what it is in each picture, where it may be missing."""
    there = [element for element in found if element is not None]
    filled = []
    for element in found:
        filled.append(element if element is not None else filled[-1] if filled else there[0])

    merged = ElementTree.Element(there[0].tag, {name: rounded(value) if name in PLACES else value for name, value in there[0].items()})
    merged.text = there[0].text
    for name in sorted(PLACES.intersection(there[0].keys())):
        animate(merged, name, [rounded(element.get(name)) for element in filled], is_smooth)
    for name in sorted(COLORS.intersection(there[0].keys())):
        animate(merged, name, [element.get(name) for element in filled], False)
    animate(merged, "visibility", ["hidden" if element is None else "visible" for element in found], False)
    return merged


def crowd(found):
    """The discs of paths with many, one element each, which moves."""
    group = ElementTree.Element(f"{{{SVG}}}g", {name: value for name, value in found[0].items() if name != "d"})
    pictures = [DISC.findall(element.get("d")) for element in found]
    count = len(pictures) + HELD
    chosen = [*range(0, len(pictures) - 1, STEP), len(pictures) - 1]
    times = [f"{i / (count - 1):.3g}" for i in chosen]
    for discs in zip(*pictures, strict=True):
        radius = float(discs[0][2])
        disc = ElementTree.SubElement(group, f"{{{SVG}}}circle", {"r": rounded(str(radius))})
        places = [f"{float(right) - radius:.1f} {float(y):.1f}" for right, y, _, _ in (discs[i] for i in chosen)]
        attributes = {"attributeName": "transform", "type": "translate", "dur": f"{count * TICK_S:g}s", "repeatCount": "indefinite"}
        attributes |= {"values": ";".join([*places, places[-1]]), "keyTimes": ";".join([*times, "1"])}
        ElementTree.SubElement(disc, f"{{{SVG}}}animateTransform", attributes)
    return group


def merge(found, depth=0, is_smooth=False):
    """One tree for the trees of all pictures."""
    there = [element for element in found if element is not None]
    merged = ElementTree.Element(there[0].tag, dict(there[0].items()))
    if len(there) < len(found):
        animate(merged, "visibility", ["hidden" if element is None else "visible" for element in found], False)

    children = [[] if element is None else list(element) for element in found]
    by_key = [dict(zip(keys(elements), elements)) for elements in children]
    for number, key in enumerate(order([list(elements) for elements in by_key])):
        parts = [elements.get(key) for elements in by_key]
        name = key[0][0]
        if name == "title":
            continue
        if name in ("svg", "g"):
            # The first of the two halves is the plan.
            merged.append(merge(parts, depth + 1, is_smooth or (depth == 0 and parts[0] is not None and parts[0].get("x") == "0")))
        elif all(part is not None and len(DISC.findall(part.get("d", ""))) > MANY for part in parts):
            merged.append(crowd(parts))
        else:
            merged.append(leaf(parts, is_smooth))
    return merged


def styled(text):
    """Fonts are named once."""
    fonts = list(dict.fromkeys(re.findall(r' style="([^"]*)"', text)))
    rules = "".join(f".f{i}{{{font.replace('&quot;', chr(39))}}}" for i, font in enumerate(fonts))
    for i, font in enumerate(fonts):
        text = text.replace(f' style="{font}"', f' class="f{i}"')
    head, rest = text.split(">", 1)
    return f"{head}><style>{rules}</style>{rest}"


def moving(pictures, title):
    """The moving picture of pictures, which are SVG."""
    ElementTree.register_namespace("", SVG)
    trees = [ElementTree.fromstring(picture) for picture in pictures]
    merged = merge(trees)
    about = ElementTree.Element(f"{{{SVG}}}title")
    about.text = title
    merged.insert(0, about)
    return styled(ElementTree.tostring(merged, encoding="unicode")) + "\n"
