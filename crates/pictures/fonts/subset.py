#!/usr/bin/env python3
"""Makes the fonts of the PDF figures from those of a folder, and prints their widths for src/print/font.rs.

    pip install fonttools==4.68.0
    ./subset.py /usr/share/fonts/truetype/liberation2

The letters have the codes of Windows' western code page; signs of charts take the six codes that are free in it. Without hints, names
and tables that a PDF does not need. The same fonts give the same bytes.
"""

import io
import pathlib
import sys
import zlib

from fontTools import subset
from fontTools.ttLib import TTFont
from fontTools.ttLib.tables._c_m_a_p import CmapSubtable

# As OTHERS in src/print/font.rs: codes 0x7f to 0x9f.
OTHERS = "−€∞‚ƒ„…†‡ˆ‰Š‹Œ↔Ž←→‘’“”•–—˜™š›œ↓žŸ"
CODES = {code: chr(code) for code in [*range(0x20, 0x7F), *range(0xA0, 0x100)]}
CODES |= {0x7F + index: letter for index, letter in enumerate(OTHERS)}
TABLES = ["OS/2", "post", "name", "gasp", "GDEF", "GPOS", "GSUB", "kern", "FFTM", "DSIG"]

for weight in ["Regular", "Bold"]:
    font = TTFont(pathlib.Path(sys.argv[1]) / f"LiberationSans-{weight}.ttf", recalcTimestamp=False)
    options = subset.Options(hinting=False, layout_features=[], notdef_outline=True, glyph_names=False, drop_tables=TABLES)
    subsetter = subset.Subsetter(options)
    subsetter.populate(text="".join(CODES.values()))
    subsetter.subset(font)

    letters = font.getBestCmap()
    symbols = CmapSubtable.newSubtable(4)
    symbols.platformID, symbols.platEncID, symbols.language = 3, 0, 0
    symbols.cmap = {0xF000 + code: letters[ord(letter)] for code, letter in sorted(CODES.items())}
    font["cmap"].tables = [symbols]

    file = io.BytesIO()
    font.save(file)
    name = pathlib.Path(__file__).parent / f"sans-{weight.lower()}.ttf.z"
    name.write_bytes(zlib.compress(file.getvalue(), 9))
    em = font["head"].unitsPerEm
    head, hhea = font["head"], font["hhea"]
    box = [round(value * 1000 / em) for value in (head.xMin, head.yMin, head.xMax, head.yMax, hhea.ascent, hhea.descent)]
    print(f"{name.name}: {len(file.getvalue())} bytes, {name.stat().st_size} compressed; box, ascent and descent {box}")
    print([round(font["hmtx"][symbols.cmap[0xF000 + code]][0] * 1000 / em) for code in sorted(CODES)])
