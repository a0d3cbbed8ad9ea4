#!/usr/bin/env python3
"""Reads a .lprt file from the text of SPEC.md alone, prints its counts and a relight under uniform radiance 1, as JSON.

Needs nothing but the standard library. Exit status 1 and a message if a rule it checks is broken.
"""
import json
import math
import struct
import sys

SCALARS = {1: "B", 2: "H", 3: "I", 4: "e", 5: "f"}
KINDS = {  # kind: (scalar, components, flag)
    "META": (1, 1, 1), "PROB": (5, 4, 1), "RDIR": (5, 4, 1), "RASH": (5, 1, 1), "RAUV": (3, 1, 1), "RALV": (1, 1, 1),
    "RTEX": (3, 1, 1), "RPOS": (5, 3, 1), "RNRM": (5, 3, 1), "RUNS": (5, 1, 1), "CLUS": (3, 10, 1), "CPRB": (3, 1, 1),
    "PROJ": (4, 1, 1), "RECO": (4, 1, 1), "GUTR": (3, 2, 1), "SEAM": (3, 2, 1), "REPT": (1, 1, 0),
    "RADS": (4, 1, 0), "VOLU": (3, 8, 0), "VCEL": (3, 1, 0), "VCLU": (3, 10, 0), "VCPR": (3, 1, 0), "VPRJ": (4, 1, 0),
    "VREC": (4, 1, 0), "VFIL": (3, 2, 0),
    "NTIL": (3, 4, 1), "NNOD": (3, 1, 1), "NCNT": (1, 1, 1), "NIDX": (1, 1, 1), "NWGT": (1, 1, 1),
}
NEAR = ["NTIL", "NNOD", "NCNT", "NIDX", "NWGT"]
CRC_TABLE = []
for byte in range(256):
    for _ in range(8):
        byte = (byte >> 1) ^ (0x82F63B78 if byte & 1 else 0)
    CRC_TABLE.append(byte)


def crc32c(data):
    crc = 0xFFFFFFFF
    for byte in data:
        crc = (crc >> 8) ^ CRC_TABLE[(crc ^ byte) & 0xFF]
    return crc ^ 0xFFFFFFFF


def require(rule, condition):
    if not condition:
        sys.exit(f"rule {rule} is broken")


def read_sections(data):
    """Header and table; returns the minor version and the numbers of each known section."""
    require(1, len(data) >= 64)
    magic, major, minor, count, length = struct.unpack_from("<8sHHIQ", data, 0)
    reserved, checksum = struct.unpack_from("<II", data, 56)
    require(2, magic == b"\x89LPR\r\n\x1a\n")
    require(3, major == 1)
    require(4, 1 <= count <= 256)
    require(5, length == len(data))
    end = 64 + 48 * count
    require(1, end <= len(data))
    require(7, crc32c(data[:60] + data[64:end]) == checksum)
    require(6, reserved == 0)
    sections = {}
    for i in range(count):
        kind, version, flags, scalar, components, crc, elements, offset, size, reserved = struct.unpack_from(
            "<4sHHHHIQQQQ", data, 64 + 48 * i)
        kind = kind.decode("ascii")
        require(11, kind not in sections)
        require(12, flags <= 1)
        require(13, scalar in SCALARS and components > 0)
        require(14, elements * components * struct.calcsize(SCALARS[scalar]) == size)
        require(6, reserved == 0)
        require(15, offset == (end + 255) // 256 * 256)
        require(17, not any(data[end:offset]))
        end = offset + size
        require(16, end <= length)
        payload = data[offset:end]
        require(22, crc32c(payload) == crc)
        if kind in KINDS and version == 1:
            require(20, (scalar, components, flags) == KINDS[kind])
            sections[kind] = struct.unpack(f"<{elements * components}{SCALARS[scalar]}", payload)
        else:
            require(18, flags == 0)
            sections[kind] = None
    require(16, end == length)
    require(21, all(kind in sections for kind, (_, _, flag) in KINDS.items() if flag and kind not in NEAR))
    return minor, sections


def read_metadata(data):
    """The META section: strings are a 64-bit length and UTF-8; numbers as they lie."""
    place = 0

    def take(layout):
        nonlocal place
        values = struct.unpack_from("<" + layout, data, place)
        place += struct.calcsize("<" + layout)
        return values

    def text():
        return take(f"{take('Q')[0]}s")[0].decode("utf-8")

    names = ["lightmap_size", "direct_size", "probe_degree", "receiver_degree", "sky_degree", "n_rays"]
    meta = {"tool_version": text(), "scene_path": text(), "scene_hash": take("32s")[0].hex()}
    meta.update(zip(names, take("6I")))
    meta["bounds"] = take("6f")
    meta["options"] = text()
    require(30, place == len(data))
    return meta


def read_volume(sections):
    """Grid of the volume; None without one."""
    kinds = [kind for kind in KINDS if kind.startswith("V")]
    require(70, sum(kind in sections for kind in kinds) in (0, len(kinds)))
    if any(sections.get(kind) is None for kind in kinds):
        return None
    words = sections["VOLU"]
    require(70, len(words) == 8)
    x, y, z, spacing = struct.unpack("<4f", struct.pack("<4I", *words[:4]))
    require(71, spacing > 0)
    require(72, 1 <= words[4] * words[5] * words[6] <= 2 ** 22)
    require(73, words[7] in (1, 2))
    return {"origin": [x, y, z], "spacing": spacing, "dims": words[4:7], "degree": words[7],
            "receivers": len(sections["VCEL"]), "filled": len(sections["VFIL"]) // 2}


def near_uniform(meta, sections, outputs, n_k):
    """Adds near light from a light map of radiance 1; returns what there is, None without any."""
    require(80, sum(kind in sections for kind in NEAR) in (0, len(NEAR)))
    if "NTIL" not in sections:
        return None
    words, nodes, counts, links, weights = (sections[kind] for kind in NEAR)
    require(80, len(words) >= 4)
    tiles = [words[4 * i:4 * i + 4] for i in range(len(words) // 4)]
    require(81, len(counts) * n_k == len(outputs) and tiles[0][:3] == (0, 0, 0))
    require(81, tiles[-1][:3] == (len(counts), len(nodes), len(links)))
    require(86, len(weights) == n_k * len(links))
    for node in nodes:
        level, size = node >> 28, meta["direct_size"] >> (node >> 28)
        require(85, 2 ** level <= meta["direct_size"] and node % 2 ** 28 < size * size)
    for tile, following in zip(tiles, tiles[1:]):
        require(82, 1 <= following[0] - tile[0] <= 64 and 0 <= following[1] - tile[1] <= 256)
        scale = struct.unpack("<f", struct.pack("<I", tile[3]))[0]
        require(84, 0 <= scale < math.inf)
        link = tile[2]
        for receiver in range(tile[0], following[0]):
            for _ in range(counts[receiver]):
                require(86, links[link] < following[1] - tile[1])
                for k in range(n_k):
                    code = weights[link * n_k + k]
                    root = (code - 256 if code > 127 else code) / 127
                    outputs[receiver * n_k + k] += scale * root * abs(root)
                link += 1
        require(83, link == following[2])
    require(84, tiles[-1][3] == 0)
    return {"tiles": len(tiles) - 1, "nodes": len(nodes), "links": len(links)}


def volume_uniform(meta, sections, volume):
    """SH radiance of every cell under the same light; None for a cell that holds nothing."""
    n_k = (volume["degree"] + 1) ** 2
    outputs = relight_uniform(meta, sections, ("VCLU", "VCPR", "VPRJ", "VREC"), n_k)
    cells = [None] * math.prod(volume["dims"])
    for receiver, cell in enumerate(sections["VCEL"]):
        cells[cell] = outputs[receiver * n_k:(receiver + 1) * n_k]
    for cell, source in zip(sections["VFIL"][::2], sections["VFIL"][1::2]):
        cells[cell] = cells[source]
    return cells


def relight_uniform(meta, sections, kinds, n_k):
    """Outputs of every receiver for radiance 1 from every mapped surface and the sky, no further bounce."""
    n_rays = meta["n_rays"]
    n_sh = (meta["probe_degree"] + 1) ** 2
    records, listed, projections, reconstructions = (sections[kind] for kind in kinds)
    table, levels = sections["RASH"], sections["RALV"]
    n_probes = len(sections["PROB"]) // 4
    radiance = [
        [sum(table[r * n_sh + j] for r in range(n_rays) if levels[p * n_rays + r] != 255) for j in range(n_sh)]
        for p in range(n_probes)]
    outputs = []
    for c in range(len(records) // 10):
        _, n_receivers, first_probe, n_listed, n_sky, n_c, _, projection, reconstruction, _ = records[10 * c:10 * c + 10]
        column = [value for p in listed[first_probe:first_probe + n_listed] for value in radiance[p]]
        column += [math.sqrt(4 * math.pi) if s == 0 else 0.0 for s in range(n_sky)]
        s_v, u = projections[2 * projection:], reconstructions[2 * reconstruction:]
        lights = [sum(s_v[i * len(column) + j] * value for j, value in enumerate(column)) for i in range(n_c)]
        outputs += [sum(u[row * n_c + i] * light for i, light in enumerate(lights)) for row in range(n_receivers * n_k)]
    return outputs


def main():
    with open(sys.argv[1], "rb") as file:
        minor, sections = read_sections(file.read())
    meta = read_metadata(bytes(sections["META"]))
    distances = sections.get("RADS") or ()
    require(40, len(distances) in (0, len(sections["RALV"])))
    require(49, all(math.copysign(1, distance) > 0 and not math.isnan(distance) for distance in distances))
    clusters = sections["CLUS"]
    n_k = (meta["receiver_degree"] + 1) ** 2
    irradiance = near = None
    if n_k == 1:
        outputs = relight_uniform(meta, sections, ("CLUS", "CPRB", "PROJ", "RECO"), n_k)
        near = near_uniform(meta, sections, outputs, n_k)
        irradiance = [max(value, 0.0) for value in outputs]
    volume = read_volume(sections)
    print(json.dumps({
        "version": [1, minor], **meta, "degrees": [meta[f"{name}_degree"] for name in ("probe", "receiver", "sky")],
        "probes": len(sections["PROB"]) // 4, "rays": len(sections["RDIR"]) // 4, "receivers": len(sections["RTEX"]),
        "clusters": len(clusters) // 10, "cluster_lights": sum(clusters[5::10]),
        "projection": len(sections["PROJ"]), "reconstruction": len(sections["RECO"]),
        "ray_distances": len(sections.get("RADS") or ()), "gutters": len(sections["GUTR"]) // 2, "seams": len(sections["SEAM"]) // 2,
        "report": bool(sections.get("REPT")), "irradiance": irradiance,
        "near": near, "volume": volume, "volume_radiance": volume and volume_uniform(meta, sections, volume),
    }))


if __name__ == "__main__":
    main()
