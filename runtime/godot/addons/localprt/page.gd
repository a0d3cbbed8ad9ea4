class_name LocalprtPage
extends RefCounted
## Whole blocks of transport, their arrays one after the other, as the shaders read them; places are the page's own.

var first_receiver: int
var n_receivers := 0
var n_clusters := 0
var n_lights := 0
var most_coefficients := 0
var clusters := PackedInt32Array()
var receiver_cluster := PackedInt32Array()
var probes := PackedByteArray()
var projection := PackedByteArray()
var reconstruction := PackedByteArray()
var n_tiles := 0
var tiles := PackedByteArray()
var nodes := PackedByteArray()
var counts := PackedByteArray()
var links := PackedByteArray()
var weights := PackedByteArray()


func _init(first := 0) -> void:
	first_receiver = first


## Bytes of the widest array with another block in it.
func widest_with(block: LocalprtBaked.Block) -> int:
	var widths := [
		projection.size() + block.reconstruction - block.projection, reconstruction.size() + block.tiles - block.reconstruction,
		16 * (n_lights + block.n_lights), probes.size() + 4 * block.n_cluster_probes, 36 * (n_clusters + block.n_clusters),
		16 * block.n_k * (n_receivers + block.n_receivers), weights.size() + block.n_links * block.n_k,
		nodes.size() + 4 * block.n_nodes,
	]
	return widths.max()


func add(block: LocalprtBaked.Block, data: PackedByteArray, n_sh: int) -> void:
	_add_tiles(block, data)
	var first_probe := probes.size() / 4
	var pair := projection.size() / 4
	var row_pair := reconstruction.size() / 4
	for number in block.n_clusters:
		var at := block.clusters + 16 * number
		var of_cluster := data.decode_u32(at)
		var n_probes := data.decode_u32(at + 4)
		var n_sky := data.decode_u32(at + 8)
		var rank := data.decode_u32(at + 12)
		clusters.append_array([n_receivers, of_cluster, first_probe, n_probes, n_sky, rank, n_lights, pair, row_pair])
		var own := PackedInt32Array()
		own.resize(of_cluster)
		own.fill(n_clusters)
		receiver_cluster.append_array(own)
		n_receivers += of_cluster
		n_clusters += 1
		n_lights += rank
		most_coefficients = maxi(most_coefficients, rank)
		first_probe += n_probes
		pair += (rank * (n_probes * n_sh + n_sky) + 1) / 2
		row_pair += (of_cluster * block.n_k * rank + 1) / 2
	probes.append_array(data.slice(block.probes, block.projection))
	projection.append_array(data.slice(block.projection, block.reconstruction))
	reconstruction.append_array(data.slice(block.reconstruction, block.tiles))


func _add_tiles(block: LocalprtBaked.Block, data: PackedByteArray) -> void:
	var place := n_receivers
	var first_node := nodes.size() / 4
	var first_link := links.size()
	var first_count := counts.size()
	for number in block.n_tiles:
		var at := block.tiles + 16 * number
		var of_tile := data.decode_u32(at)
		var n_nodes := data.decode_u32(at + 4)
		var record := PackedByteArray()
		record.resize(32)
		for word in [[0, first_count], [4, of_tile], [8, first_node], [12, n_nodes], [16, first_link], [20, data.decode_u32(at + 12)], [24, place]]:
			record.encode_u32(word[0], word[1])
		tiles.append_array(record)
		first_count += of_tile
		first_node += n_nodes
		first_link += data.decode_u32(at + 8)
		place += of_tile
	n_tiles += block.n_tiles
	nodes.append_array(data.slice(block.nodes, block.counts))
	counts.append_array(data.slice(block.counts, block.links))
	links.append_array(data.slice(block.links, block.weights))
	weights.append_array(data.slice(block.weights, block.end))
