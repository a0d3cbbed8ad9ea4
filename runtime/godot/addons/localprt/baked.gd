class_name LocalprtBaked
extends RefCounted
## A baked file, read from the text of formats/SPEC.md: what the passes upload, as bytes that shaders read.
##
## [method open] checks the rules whose breaking would let a shader read what is not there: 1 to 7, 10 to 21, 30 to 34, 40, 44, 45, 50,
## 51, 55 to 58 (of 56 the range alone), 60, 81 to 83, 85 and 86. [method check_payloads] reads every byte once more, rules 22 and 88.

const MAGIC: PackedByteArray = [0x89, 0x4c, 0x50, 0x52, 0x0d, 0x0a, 0x1a, 0x0a]
const HEADER := 64
const ENTRY := 48
const ALIGNMENT := 256
const WIDTHS := { 1: 1, 2: 2, 3: 4, 4: 2, 5: 4 }
const LEVEL_SKY := 254
const LEVEL_BLACK := 255
const MOST_LEVEL := 15

## Kind: scalar, scalars per element, whether it is required.
const SECTIONS := {
	"META": [1, 1, true], "PROB": [5, 4, true], "RDIR": [5, 4, true], "RASH": [5, 1, true], "RAUV": [3, 1, true],
	"RALV": [1, 1, true], "RADS": [4, 1, false], "RTEX": [3, 1, true], "RPOS": [5, 3, true], "RNRM": [5, 3, true],
	"RUNS": [5, 1, true], "BLOK": [3, 32, true], "BDAT": [3, 1, true], "GUTR": [3, 2, true], "SEAM": [3, 2, true],
	"VOLU": [3, 8, false], "VCEL": [3, 1, false], "VBLK": [3, 32, false], "VDAT": [3, 1, false], "VFIL": [3, 2, false],
	"REPT": [1, 1, false], "PLAN": [1, 1, false],
}

## What is wrong with the file, with its name, the rule and the place; empty if nothing is.
var error := ""
var path := ""
var version := Vector2i.ZERO
var content_hash := PackedByteArray()

var tool_version := ""
var scene_path := ""
var scene_hash := PackedByteArray()
var lightmap_size := 0
var direct_size := 0
var probe_degree := 0
var receiver_degree := 0
var sky_degree := 0
var n_rays := 0
var bounds := AABB()
var options := ""

var n_probes := 0
var n_receivers := 0
var n_blocks := 0

var n_sh: int:
	get:
		return (probe_degree + 1) * (probe_degree + 1)
var n_k: int:
	get:
		return (receiver_degree + 1) * (receiver_degree + 1)
var n_sky: int:
	get:
		return (sky_degree + 1) * (sky_degree + 1)

var _bytes := PackedByteArray()
## Kind to offset, length, elements, checksum.
var _sections := {}


## Reads a file. What is wrong with it is in [member error].
static func open(file: String) -> LocalprtBaked:
	var bytes := FileAccess.get_file_as_bytes(file)
	if bytes.is_empty() and FileAccess.get_open_error() != OK:
		var missing := LocalprtBaked.new()
		missing.error = "%s: %s" % [file, error_string(FileAccess.get_open_error())]
		return missing
	return from_bytes(bytes, file)


## The same of bytes, with a name for messages.
static func from_bytes(bytes: PackedByteArray, name: String) -> LocalprtBaked:
	var baked := LocalprtBaked.new()
	baked.path = name
	baked._bytes = bytes
	if baked._read_header() and baked._read_table() and baked._read_metadata():
		baked._check_arrays()
	return baked


## Bytes of a section as they lie in the file; none if there is no such section.
func section(kind: String) -> PackedByteArray:
	if kind not in _sections:
		return PackedByteArray()
	var entry: Array = _sections[kind]
	return _bytes.slice(entry[0], entry[0] + entry[1])


## Elements of a section, 0 without it.
func count(kind: String) -> int:
	return _sections[kind][2] if kind in _sections else 0


## Kinds of the sections that were found, those that nobody knows left out.
func kinds() -> Array:
	return _sections.keys()


## Reads every byte: checksums of all payloads and blocks. Some seconds for each 100 MB.
func check_payloads() -> bool:
	for kind in _sections:
		if crc32c(section(kind)) != _sections[kind][3]:
			return _fail(22, "section %s: its checksum is another" % kind)
	var table := section("BLOK")
	var data := section("BDAT")
	for block in n_blocks:
		var at := 128 * block
		var from := table.decode_u64(at + 40)
		var to := data.size() if block + 1 == n_blocks else table.decode_u64(at + 128 + 40)
		if crc32c(data.slice(from, to)) != table.decode_u32(at + 36):
			return _fail(88, "block %d: its checksum is another" % block)
	return true


## The Castagnoli checksum.
static func crc32c(bytes: PackedByteArray) -> int:
	var table := PackedInt64Array()
	for byte in 256:
		var value: int = byte
		for bit in 8:
			value = (value >> 1) ^ (0x82f63b78 if value & 1 else 0)
		table.append(value)
	var crc := 0xffffffff
	for byte in bytes:
		crc = (crc >> 8) ^ table[(crc ^ byte) & 0xff]
	return crc ^ 0xffffffff


func _fail(rule: int, problem: String) -> bool:
	error = "%s: %s (rule %d)" % [path, problem, rule]
	return false


func _read_header() -> bool:
	if _bytes.size() < HEADER:
		return _fail(1, "%d bytes are no header" % _bytes.size())
	if _bytes.slice(0, 8) != MAGIC:
		return _fail(2, "not a localprt file")
	version = Vector2i(_bytes.decode_u16(8), _bytes.decode_u16(10))
	if version.x != 2:
		return _fail(3, "version %d.%d: bake the scene again" % [version.x, version.y])
	var n := _bytes.decode_u32(12)
	if n < 1 or n > 256:
		return _fail(4, "%d sections" % n)
	if _bytes.size() < HEADER + ENTRY * n:
		return _fail(1, "%d bytes do not hold the table of %d sections" % [_bytes.size(), n])
	if _bytes.decode_u64(16) != _bytes.size():
		return _fail(5, "says it has %d bytes, has %d" % [_bytes.decode_u64(16), _bytes.size()])
	if _bytes.decode_u32(56) != 0:
		return _fail(6, "header: reserved bytes are not 0")
	var checked := _bytes.slice(0, 60)
	checked.append_array(_bytes.slice(HEADER, HEADER + ENTRY * n))
	if crc32c(checked) != _bytes.decode_u32(60):
		return _fail(7, "header: its checksum is another")
	content_hash = _bytes.slice(24, 56)
	return true


func _read_table() -> bool:
	var n := _bytes.decode_u32(12)
	var end := HEADER + ENTRY * n
	var seen := {}
	for number in n:
		var at := HEADER + ENTRY * number
		var kind := ""
		for byte in _bytes.slice(at, at + 4):
			if not (byte >= 0x41 and byte <= 0x5a or byte >= 0x30 and byte <= 0x39):
				return _fail(10, "entry %d of the table: its kind is not four of A-Z and 0-9" % number)
			kind += char(byte)
		var where := "section %s" % kind
		if kind in seen:
			return _fail(11, "%s: occurs twice" % where)
		seen[kind] = true
		var section_version := _bytes.decode_u16(at + 4)
		var flags := _bytes.decode_u16(at + 6)
		var scalar := _bytes.decode_u16(at + 8)
		var per_element := _bytes.decode_u16(at + 10)
		var elements := _bytes.decode_u64(at + 16)
		var offset := _bytes.decode_u64(at + 24)
		var length := _bytes.decode_u64(at + 32)
		if _bytes.decode_u64(at + 40) != 0:
			return _fail(6, "%s: reserved bytes are not 0" % where)
		if flags > 1:
			return _fail(12, "%s: flags %d" % [where, flags])
		if scalar not in WIDTHS or per_element == 0:
			return _fail(13, "%s: scalar %d, %d per element" % [where, scalar, per_element])
		# As signed numbers, and without a product that overflows.
		var width: int = WIDTHS[scalar] * per_element
		if elements < 0 or length < 0 or length % width != 0 or length / width != elements:
			return _fail(14, "%s: %d elements in %d bytes" % [where, elements, length])
		if offset != _aligned(end) or length > _bytes.size() - offset:
			return _fail(15, "%s: at byte %d" % [where, offset])
		if _bytes.slice(end, offset).count(0) != offset - end:
			return _fail(17, "%s: bytes before it are not 0" % where)
		end = offset + length
		if kind not in SECTIONS:
			if flags == 1:
				return _fail(18, "%s: is required, and not known here" % where)
			continue
		var expected: Array = SECTIONS[kind]
		if section_version != 1:
			if expected[2] or flags == 1:
				return _fail(19, "%s: version %d" % [where, section_version])
			continue
		if scalar != expected[0] or per_element != expected[1] or (flags == 1) != expected[2]:
			return _fail(20, "%s: scalar %d, %d per element, flags %d" % [where, scalar, per_element, flags])
		_sections[kind] = [offset, length, elements, _bytes.decode_u32(at + 12)]
	if end != _bytes.size():
		return _fail(16, "%d bytes after the last section" % (_bytes.size() - end))
	for kind in SECTIONS:
		if SECTIONS[kind][2] and kind not in _sections:
			return _fail(21, "section %s: is missing" % kind)
	return true


func _read_metadata() -> bool:
	var reader := StreamPeerBuffer.new()
	reader.data_array = section("META")
	# Three strings of eight bytes and more, a hash, six numbers and six floats.
	if reader.get_size() < 3 * 8 + 32 + 12 * 4:
		return _fail(30, "section META: %d bytes" % reader.get_size())
	var strings: Array[String] = []
	for text in 3:
		if text == 2:
			scene_hash = reader.data_array.slice(reader.get_position(), reader.get_position() + 32)
			reader.seek(reader.get_position() + 32)
			var left := reader.get_size() - reader.get_position()
			if left < 12 * 4 + 8:
				return _fail(30, "section META: ends early")
			lightmap_size = reader.get_u32()
			direct_size = reader.get_u32()
			probe_degree = reader.get_u32()
			receiver_degree = reader.get_u32()
			sky_degree = reader.get_u32()
			n_rays = reader.get_u32()
			var corners: Array[Vector3] = []
			for corner in 2:
				corners.append(Vector3(reader.get_float(), reader.get_float(), reader.get_float()))
			bounds = AABB(corners[0], corners[1] - corners[0])
		var length := reader.get_u64()
		var left := reader.get_size() - reader.get_position()
		if length < 0 or length > left:
			return _fail(30, "section META: a string of %d bytes" % length)
		strings.append(reader.data_array.slice(reader.get_position(), reader.get_position() + length).get_string_from_utf8())
		reader.seek(reader.get_position() + length)
		if text == 1 and reader.get_size() - reader.get_position() < 32 + 12 * 4 + 8:
			return _fail(30, "section META: ends early")
	if reader.get_position() != reader.get_size():
		return _fail(30, "section META: %d bytes too many" % (reader.get_size() - reader.get_position()))
	tool_version = strings[0]
	scene_path = strings[1]
	options = strings[2]
	if probe_degree > 10 or sky_degree > 10 or receiver_degree > 1:
		return _fail(31, "section META: degrees %d, %d and %d" % [probe_degree, receiver_degree, sky_degree])
	if lightmap_size < 1 or lightmap_size > 16384 or nearest_po2(direct_size) != direct_size or direct_size < 1 or direct_size > 16384:
		return _fail(32, "section META: maps of %d and %d texels" % [lightmap_size, direct_size])
	if n_rays < 1 or n_rays > 1 << 20:
		return _fail(33, "section META: %d rays" % n_rays)
	if not bounds.position.is_finite() or not bounds.size.is_finite() or minf(bounds.size.x, minf(bounds.size.y, bounds.size.z)) < 0.0:
		return _fail(34, "section META: bounds %s" % bounds)
	return true


func _check_arrays() -> bool:
	n_probes = count("PROB")
	n_receivers = count("RTEX")
	n_blocks = count("BLOK")
	for expected in [
		["RDIR", n_rays], ["RASH", n_rays * n_sh], ["RAUV", n_probes * n_rays], ["RALV", n_probes * n_rays],
		["RPOS", n_receivers], ["RNRM", n_receivers], ["RUNS", n_receivers],
	]:
		if count(expected[0]) != expected[1]:
			return _fail(40, "section %s: %d elements instead of %d" % [expected[0], count(expected[0]), expected[1]])
	if count("RADS") != 0 and count("RADS") != n_probes * n_rays:
		return _fail(40, "section RADS: %d elements instead of %d" % [count("RADS"), n_probes * n_rays])
	var levels := section("RALV")
	var n_known := levels.count(LEVEL_SKY) + levels.count(LEVEL_BLACK)
	for level in n_levels():
		n_known += levels.count(level)
	if n_known != levels.size():
		return _fail(44, "section RALV: a level beyond %d" % (n_levels() - 1))
	if not _is_below(section("RTEX").to_int32_array(), lightmap_size * lightmap_size):
		return _fail(45, "section RTEX: a texel beyond the map's")
	var gutters := section("GUTR").to_int32_array()
	for at in gutters.size():
		if gutters[at] < 0 or gutters[at] >= (n_receivers if at % 2 else lightmap_size * lightmap_size):
			return _fail(60, "section GUTR: gutter %d" % (at / 2))
	return _check_blocks()


## Levels that relight rays may read.
func n_levels() -> int:
	var n := 1
	while 1 << n <= direct_size and n <= MOST_LEVEL:
		n += 1
	return n


## Sizes and indices of the blocks: rules 50 and 51, and what is within.
func _check_blocks() -> bool:
	var table := section("BLOK")
	var data := section("BDAT")
	var receivers := 0
	var end := 0
	for number in n_blocks:
		var block := Block.new(table, number, n_k)
		var where := "block %d" % number
		if block.offset != end:
			return _fail(51, "%s: at byte %d, not %d" % [where, block.offset, end])
		end = block.offset + _aligned(block.n_bytes())
		if end > data.size():
			return _fail(51, "%s: ends at byte %d of %d" % [where, end, data.size()])
		if block.n_receivers < 1:
			return _fail(50, "%s: no receivers" % where)
		receivers += block.n_receivers
		var problem := block.problem(self, data)
		if problem:
			return _fail(problem[0], "%s: %s" % [where, problem[1]])
	if receivers != n_receivers:
		return _fail(50, "blocks of %d receivers, and %d" % [receivers, n_receivers])
	if end != data.size():
		return _fail(51, "section BDAT: %d bytes after the last block" % (data.size() - end))
	return true


static func _aligned(at: int) -> int:
	return (at + ALIGNMENT - 1) / ALIGNMENT * ALIGNMENT


## Whether all numbers, which are unsigned in the file, are below a limit under 2^31.
static func _is_below(numbers: PackedInt32Array, limit: int) -> bool:
	if numbers.is_empty():
		return true
	var sorted := numbers.duplicate()
	sorted.sort()
	return sorted[0] >= 0 and sorted[-1] < limit


## One block of transport: counts from the table, and where its arrays begin in BDAT.
class Block:
	var n_receivers: int
	var n_clusters: int
	var n_cluster_probes: int
	var n_lights: int
	var n_tiles: int
	var n_nodes: int
	var n_links: int
	var offset: int
	var n_k: int
	## Where each array begins, and the end of the last.
	var clusters: int
	var probes: int
	var projection: int
	var reconstruction: int
	var tiles: int
	var nodes: int
	var counts: int
	var links: int
	var weights: int
	var end: int

	func _init(table: PackedByteArray, number: int, outputs: int) -> void:
		var at := 128 * number
		n_k = outputs
		n_receivers = table.decode_u32(at)
		n_clusters = table.decode_u32(at + 4)
		n_cluster_probes = table.decode_u32(at + 8)
		n_lights = table.decode_u32(at + 12)
		n_tiles = table.decode_u32(at + 24)
		n_nodes = table.decode_u32(at + 28)
		n_links = table.decode_u32(at + 32)
		offset = table.decode_u64(at + 40)
		clusters = offset
		probes = clusters + 16 * n_clusters
		projection = probes + 4 * n_cluster_probes
		reconstruction = projection + 4 * table.decode_u32(at + 16)
		tiles = reconstruction + 4 * table.decode_u32(at + 20)
		nodes = tiles + 16 * n_tiles
		counts = nodes + 4 * n_nodes
		links = counts + (n_receivers if n_tiles > 0 else 0)
		weights = links + n_links
		end = weights + n_links * n_k

	func n_bytes() -> int:
		return end - offset

	## A rule that is broken, and how; empty if none is.
	func problem(file: LocalprtBaked, data: PackedByteArray) -> Array:
		if n_tiles == 0 and n_nodes + n_links > 0:
			return [81, "links without tiles"]
		var sums := [0, 0, 0, 0, 0]
		for number in n_clusters:
			var at := clusters + 16 * number
			var of_cluster := data.decode_u32(at)
			var n_of_probes := data.decode_u32(at + 4)
			var n_sky := data.decode_u32(at + 8)
			var rank := data.decode_u32(at + 12)
			if of_cluster < 1:
				return [55, "cluster %d: no receivers" % number]
			if n_sky != 0 and n_sky != file.n_sky or rank > 255:
				return [57, "cluster %d: %d sky columns, %d coefficients" % [number, n_sky, rank]]
			sums[0] += of_cluster
			sums[1] += n_of_probes
			sums[2] += rank
			sums[3] += (rank * (n_of_probes * file.n_sh + n_sky) + 1) / 2
			sums[4] += (of_cluster * n_k * rank + 1) / 2
		if sums[0] != n_receivers:
			return [55, "clusters of %d receivers, and %d" % [sums[0], n_receivers]]
		if sums[1] != n_cluster_probes or not LocalprtBaked._is_below(data.slice(probes, projection).to_int32_array(), file.n_probes):
			return [56, "its clusters' probes"]
		if sums[2] != n_lights:
			return [57, "clusters of %d coefficients, and %d" % [sums[2], n_lights]]
		if 4 * sums[3] != reconstruction - projection or 4 * sums[4] != tiles - reconstruction:
			return [58, "matrices of other sizes"]
		return _near_problem(file, data)

	func _near_problem(file: LocalprtBaked, data: PackedByteArray) -> Array:
		var sums := [0, 0, 0]
		for number in n_tiles:
			var at := tiles + 16 * number
			var of_tile := data.decode_u32(at)
			var n_of_nodes := data.decode_u32(at + 4)
			var n_of_links := data.decode_u32(at + 8)
			if of_tile < 1 or of_tile > 64:
				return [81, "tile %d: %d receivers" % [number, of_tile]]
			if n_of_nodes > 256:
				return [82, "tile %d: %d nodes" % [number, n_of_nodes]]
			if sums[0] + of_tile > n_receivers or sums[2] + n_of_links > n_links:
				return [83, "tile %d: more receivers or links than the block has" % number]
			var n_counted := 0
			for receiver in of_tile:
				n_counted += data[counts + sums[0] + receiver]
			if n_counted != n_of_links:
				return [83, "tile %d: %d links, and %d counted" % [number, n_of_links, n_counted]]
			if n_of_links > 0:
				var own := data.slice(links + sums[2], links + sums[2] + n_of_links)
				own.sort()
				if own[-1] >= n_of_nodes:
					return [86, "tile %d: a link to node %d of %d" % [number, own[-1], n_of_nodes]]
			sums[0] += of_tile
			sums[1] += n_of_nodes
			sums[2] += n_of_links
		if n_tiles > 0 and sums[0] != n_receivers:
			return [81, "tiles of %d receivers, and %d" % [sums[0], n_receivers]]
		if sums[1] != n_nodes or sums[2] != n_links:
			return [82, "tiles of %d nodes and %d links, and %d and %d" % [sums[1], sums[2], n_nodes, n_links]]
		var n_levels := file.n_levels()
		for node in n_nodes:
			var address := data.decode_u32(nodes + 4 * node)
			var level := address >> 28
			var size := file.direct_size >> level
			if level >= n_levels or (address & 0x0fffffff) >= size * size:
				return [85, "node %d: level %d, texel %d" % [node, level, address & 0x0fffffff]]
		return []
