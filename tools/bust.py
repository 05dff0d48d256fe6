#!/usr/bin/env python3
"""Writes models/bust.obj: rings whose radius depends on height and azimuth. tools/bust.py > models/bust.obj"""
import math

ROWS, AROUND = 56, 52


def bump(x, middle, width):
    return math.exp(-(((x - middle) / width) ** 2))


def radius(z, azimuth):
    """Of a bust one unit high whose face looks along +y."""
    c, s = math.cos(azimuth), math.sin(azimuth)
    if z < 0.12:
        return 0.23 - 0.09 * min(1, max(0, (z - 0.09) / 0.03))
    shoulders = 0.14 + 0.13 * bump(z, 0.30, 0.11) * (0.45 + 0.55 * c * c)
    neck = 0.085
    head = 0.17 * math.sqrt(max(0.0, 1 - ((z - 0.75) / 0.235) ** 2))
    part = min(1, max(0, (z - 0.40) / 0.08))
    part = part * part * (3 - 2 * part)
    r = shoulders * (1 - part) + neck * part
    if z >= 0.56:
        r = max(head, neck * max(0, 1 - (z - 0.56) / 0.08))
    if z > 0.55:
        front = max(0.0, s)
        face = 0.075 * bump(z, 0.715, 0.05) * front**24
        face += 0.022 * bump(z, 0.80, 0.02) * front**3
        face -= 0.03 * bump(z, 0.765, 0.025) * (bump(abs(c), 0.42, 0.16) if s > 0 else 0)
        face += 0.03 * bump(z, 0.585, 0.03) * front**6
        face -= 0.014 * bump(z, 0.645, 0.012) * front**5
        face += 0.02 * bump(z, 0.83, 0.12) * max(0.0, -s) ** 0.5 * (1 + 0.5 * math.sin(9 * azimuth))
        face += 0.035 * bump(z, 0.74, 0.05) * abs(c) ** 22
        r += face * min(1, head / 0.05)
    return r


def main():
    heights = [0.0, 0.085, 0.1]
    heights += [0.12 + 0.862 * row / (ROWS - 4) for row in range(ROWS - 3)]
    lines = ["# A bust, one unit high, its face towards +y; made by tools/bust.py."]
    for z in heights:
        for step in range(AROUND):
            azimuth = 2 * math.pi * step / AROUND
            r = radius(z, azimuth)
            # Heads are narrower than deep.
            across = 1.0 if z < 0.56 else 0.86
            lines.append(f"v {r * across * math.cos(azimuth):.4f} {r * math.sin(azimuth):.4f} {z:.4f}")
    lines += ["v 0 0 0", "v 0 0 0.99"]
    bottom, top = len(heights) * AROUND + 1, len(heights) * AROUND + 2
    for row in range(len(heights) - 1):
        for step in range(AROUND):
            a, b = (row * AROUND + it % AROUND + 1 for it in (step, step + 1))
            c, d = b + AROUND, a + AROUND
            lines += [f"f {a} {b} {c}", f"f {a} {c} {d}"]
    for step in range(AROUND):
        a, b = (it % AROUND + 1 for it in (step, step + 1))
        last = (len(heights) - 1) * AROUND
        lines += [f"f {bottom} {b} {a}", f"f {top} {a + last} {b + last}"]
    print("\n".join(lines))


main()
