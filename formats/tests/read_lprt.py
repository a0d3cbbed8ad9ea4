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
    "RADS": (4, 1, 0), "RTEX": (3, 1, 1), "RPOS": (5, 3, 1), "RNRM": (5, 3, 1), "RUNS": (5, 1, 1), "BLOK": (3, 32, 1),
    "BDAT": (3, 1, 1), "GUTR": (3, 2, 1), "SEAM": (3, 2, 1), "VOLU": (3, 8, 0), "VCEL": (3, 1, 0), "VBLK": (3, 32, 0),
    "VDAT": (3, 1, 0), "VFIL": (3, 2, 0), "REPT": (1, 1, 0), "PLAN": (1, 1, 0),
}
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
    require(3, major == 2)
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
    require(21, all(kind in sections for kind, (_, _, flag) in KINDS.items() if flag))
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


def read_blocks(records, words, n_k):
    """Blocks of transport: a list of dicts of their arrays."""
    data = struct.pack(f"<{len(words)}I", *words)
    blocks, place = [], 0
    for record in zip(*[iter(records)] * 32):
        n_receivers, n_clusters, n_listed, n_lights, pairs_s_v, pairs_u, n_tiles, n_nodes, n_links, crc, low, high = record[:12]
        require(51, low + (high << 32) == place)
        require(53, not any(record[26:]))
        require(54, n_tiles > 0 or n_nodes == n_links == 0)
        counts = [("clusters", 4 * n_clusters, "I"), ("probes", n_listed, "I"), ("projection", 2 * pairs_s_v, "e"),
                  ("reconstruction", 2 * pairs_u, "e"), ("tiles", 4 * n_tiles, "I"), ("nodes", n_nodes, "I"),
                  ("counts", n_receivers if n_tiles else 0, "B"), ("links", n_links, "B"), ("weights", n_links * n_k, "b")]
        first, block = place, {"receivers": n_receivers, "lights": n_lights}
        for name, count, scalar in counts:
            require(51, place + count * struct.calcsize(scalar) <= len(data))
            block[name] = struct.unpack_from(f"<{count}{scalar}", data, place)
            place += count * struct.calcsize(scalar)
        end = (place + 255) // 256 * 256
        require(51, end <= len(data))
        require(87, not any(data[place:end]))
        require(88, crc32c(data[first:end]) == crc)
        place = end
        blocks.append(block)
    require(51, place == len(data))
    return blocks


def near_uniform(meta, blocks, outputs, n_k):
    """Adds near light from a light map of radiance 1; returns what there is."""
    receiver = 0
    for block in blocks:
        for node in block["nodes"]:
            level, size = node >> 28, meta["direct_size"] >> (node >> 28)
            require(85, 2 ** level <= meta["direct_size"] and node % 2 ** 28 < size * size)
        link = counted = 0
        for n_receivers, n_nodes, n_links, bits in zip(*[iter(block["tiles"])] * 4):
            require(81, 1 <= n_receivers <= 64)
            require(82, n_nodes <= 256)
            scale = struct.unpack("<f", struct.pack("<I", bits))[0]
            require(84, 0 <= scale < math.inf)
            first_link = link
            for _ in range(n_receivers):
                for _ in range(block["counts"][counted]):
                    require(86, block["links"][link] < n_nodes)
                    for k in range(n_k):
                        root = block["weights"][link * n_k + k] / 127
                        outputs[(receiver + counted) * n_k + k] += scale * root * abs(root)
                    link += 1
                counted += 1
            require(83, link == first_link + n_links)
        require(81, counted == (block["receivers"] if block["tiles"] else 0))
        require(83, link == len(block["links"]))
        receiver += block["receivers"]
    return {"tiles": sum(len(block["tiles"]) // 4 for block in blocks), "nodes": sum(len(block["nodes"]) for block in blocks),
            "links": sum(len(block["links"]) for block in blocks)}


def volume_uniform(meta, sections, volume):
    """SH radiance of every cell under the same light; None for a cell that holds nothing."""
    n_k = (volume["degree"] + 1) ** 2
    outputs = relight_uniform(meta, sections, read_blocks(sections["VBLK"], sections["VDAT"], n_k), n_k)
    cells = [None] * math.prod(volume["dims"])
    for receiver, cell in enumerate(sections["VCEL"]):
        cells[cell] = outputs[receiver * n_k:(receiver + 1) * n_k]
    for cell, source in zip(sections["VFIL"][::2], sections["VFIL"][1::2]):
        cells[cell] = cells[source]
    return cells


def relight_uniform(meta, sections, blocks, n_k):
    """Outputs of every receiver for radiance 1 from every mapped surface and the sky, no further bounce."""
    n_rays = meta["n_rays"]
    n_sh = (meta["probe_degree"] + 1) ** 2
    table, levels = sections["RASH"], sections["RALV"]
    n_probes = len(sections["PROB"]) // 4
    radiance = [
        [sum(table[r * n_sh + j] for r in range(n_rays) if levels[p * n_rays + r] != 255) for j in range(n_sh)]
        for p in range(n_probes)]
    outputs = []
    for block in blocks:
        probes = projection = reconstruction = receivers = 0
        for n_receivers, n_listed, n_sky, n_c in zip(*[iter(block["clusters"])] * 4):
            column = [value for p in block["probes"][probes:probes + n_listed] for value in radiance[p]]
            column += [math.sqrt(4 * math.pi) if s == 0 else 0.0 for s in range(n_sky)]
            s_v, u = block["projection"][projection:], block["reconstruction"][reconstruction:]
            lights = [sum(s_v[i * len(column) + j] * value for j, value in enumerate(column)) for i in range(n_c)]
            rows = n_receivers * n_k
            outputs += [sum(u[row * n_c + i] * light for i, light in enumerate(lights)) for row in range(rows)]
            probes += n_listed
            projection += (n_c * len(column) + 1) // 2 * 2
            reconstruction += (rows * n_c + 1) // 2 * 2
            receivers += n_receivers
        require(55, receivers == block["receivers"])
        require(56, probes == len(block["probes"]))
        require(58, (projection, reconstruction) == (len(block["projection"]), len(block["reconstruction"])))
    return outputs


def main():
    with open(sys.argv[1], "rb") as file:
        minor, sections = read_sections(file.read())
    meta = read_metadata(bytes(sections["META"]))
    distances = sections.get("RADS") or ()
    require(40, len(distances) in (0, len(sections["RALV"])))
    require(49, all(math.copysign(1, distance) > 0 and not math.isnan(distance) for distance in distances))
    n_k = (meta["receiver_degree"] + 1) ** 2
    blocks = read_blocks(sections["BLOK"], sections["BDAT"], n_k)
    require(50, sum(block["receivers"] for block in blocks) == len(sections["RTEX"]))
    irradiance = near = None
    if n_k == 1:
        outputs = relight_uniform(meta, sections, blocks, n_k)
        near = near_uniform(meta, blocks, outputs, n_k)
        irradiance = [max(value, 0.0) for value in outputs]
    volume = read_volume(sections)
    print(json.dumps({
        "version": [2, minor], **meta, "degrees": [meta[f"{name}_degree"] for name in ("probe", "receiver", "sky")],
        "probes": len(sections["PROB"]) // 4, "rays": len(sections["RDIR"]) // 4, "receivers": len(sections["RTEX"]),
        "blocks": len(blocks), "clusters": sum(len(block["clusters"]) // 4 for block in blocks),
        "cluster_lights": sum(block["lights"] for block in blocks),
        "projection": sum(len(block["projection"]) for block in blocks),
        "reconstruction": sum(len(block["reconstruction"]) for block in blocks),
        "ray_distances": len(sections.get("RADS") or ()), "gutters": len(sections["GUTR"]) // 2, "seams": len(sections["SEAM"]) // 2,
        "report": bool(sections.get("REPT")), "plan": bool(sections.get("PLAN")), "irradiance": irradiance,
        "near": near, "volume": volume, "volume_radiance": volume and volume_uniform(meta, sections, volume),
    }))


if __name__ == "__main__":
    main()
