class_name Localprt
extends Node3D
## Bounced light of a baked scene, which follows the scene's lamps, glowing materials and sky from frame to frame.
##
## Every mesh below [member scene] that has a second set of texture coordinates gets the light map. Lights, materials and the
## environment are read every frame. Forward+ and Mobile alone have the RenderingDevice that this needs.

## The light map is there, or [member error] says why not.
signal loaded

## The baked file.
@export_file("*.lprt") var file := ""
## Its surfaces, from `localprt-godot surfaces`; beside the file if empty.
@export_file("*.surfaces") var surfaces := ""
## Root of the baked scene's meshes, in the place of the scene's origin; the parent if empty.
@export_node_path("Node3D") var scene: NodePath
## Root of the lights that shine on it; all lights of the tree if empty.
@export_node_path("Node") var lights: NodePath
## Gathers in a frame: more of them bring later bounces sooner.
@export_range(1, 16) var bounces := 1
## Texels per side of the shadow maps that shadow bounced light.
@export_range(256, 8192) var shadow_map_size := 2048
## Light with directions, for normal maps, of files that have them (`--receiver-degree 1`).
@export var directional := true
## Take the sky from the background color of the world's environment.
@export var sky_from_environment := true
## Radiance of the sky, if not from the environment.
@export var sky := Color.BLACK
## Relight in every frame. Without it, call [method update].
@export var automatic := true

## Why there is no light map; empty if there is one.
var error := ""

var _relighter: LocalprtRelighter
var _texture := Texture2DArrayRD.new()
var _lightmap: LightmapGI
var _meshes: Array[MeshInstance3D] = []
## All lights of the tree.
var _lights: Array[Light3D] = []
var _material_names := PackedStringArray()
## Materials of the engine by number of the scene's, and what they emitted at first.
var _materials := {}
var _first_emission := {}
var _sent_emission := PackedFloat32Array()
var _sent_sky := Vector3.ZERO
var _is_ready := false


func _init() -> void:
	# After those who move lights.
	process_priority = 1000


func _enter_tree() -> void:
	_lights.assign(get_tree().root.find_children("*", "Light3D", true, false))
	get_tree().node_added.connect(_on_node_added)
	get_tree().node_removed.connect(_on_node_removed)


func _exit_tree() -> void:
	get_tree().node_added.disconnect(_on_node_added)
	get_tree().node_removed.disconnect(_on_node_removed)
	_lights.clear()


func _ready() -> void:
	if Engine.is_editor_hint() or file.is_empty():
		return
	load_file()


func _process(_delta: float) -> void:
	if automatic and _is_ready:
		update()


func _notification(what: int) -> void:
	if what == NOTIFICATION_PREDELETE:
		unload()


## Loads [member file] with its surfaces, in place of what was loaded before. False, and [member error], if it cannot.
func load_file() -> bool:
	unload()
	error = ""
	var baked := LocalprtBaked.open(file)
	if baked.error:
		return _fail(baked.error)
	var path := surfaces if surfaces else file.get_basename() + ".surfaces"
	var texels := LocalprtSurfaces.open(path)
	if texels.error:
		return _fail(texels.error)
	if texels.content_hash != baked.content_hash or texels.direct_size != baked.direct_size:
		return _fail("%s is of another bake than %s: write it again" % [path, file])
	_material_names = texels.materials
	_relighter = LocalprtRelighter.new()
	var folder: String = (get_script() as Script).resource_path.get_base_dir().path_join(LocalprtRelighter.SHADERS)
	RenderingServer.call_on_render_thread(_setup.bind(_relighter, baked, texels, folder))
	return error.is_empty()


## Takes lights, materials and sky, and relights once. For scripts that decide themselves when; before the frame is drawn.
func update() -> void:
	if not _is_ready:
		return
	var lamps := _lamps()
	var emission := _emission()
	var radiance := _sky_radiance()
	var changed_emission := emission if emission != _sent_emission else PackedFloat32Array()
	var changed_sky := [radiance] if radiance != _sent_sky else []
	_sent_emission = emission
	_sent_sky = radiance
	RenderingServer.call_on_render_thread(_frame.bind(_relighter, lamps, changed_emission, changed_sky, bounces))


## Forgets all light: for cuts.
func reset() -> void:
	if _relighter:
		RenderingServer.call_on_render_thread(_relighter.reset)


## Meshes that have the light map.
func meshes() -> Array[MeshInstance3D]:
	return _meshes


## Bytes on the device by purpose.
func memory() -> Dictionary:
	return _relighter.memory if _relighter else {}


## The relighter, for the render thread.
func relighter() -> LocalprtRelighter:
	return _relighter


## Looks for meshes again: after some have come or gone.
func find_meshes() -> void:
	if _is_ready:
		_assign()


## Gives the device's memory back; the meshes are without light map then.
func unload() -> void:
	_is_ready = false
	if is_instance_valid(_lightmap):
		_lightmap.light_data = null
		_lightmap.queue_free()
	_lightmap = null
	_meshes.clear()
	_first_emission.clear()
	if _relighter:
		_texture.texture_rd_rid = RID()
		RenderingServer.call_on_render_thread(_relighter.free_all)
		_relighter = null


func _on_node_added(node: Node) -> void:
	if node is Light3D and node not in _lights:
		_lights.append(node)


func _on_node_removed(node: Node) -> void:
	if node is Light3D:
		_lights.erase(node)


func _fail(problem: String) -> bool:
	error = problem
	push_error("localprt: %s" % problem)
	loaded.emit.call_deferred()
	return false


## On the render thread.
func _setup(relighter_: LocalprtRelighter, baked: LocalprtBaked, texels: LocalprtSurfaces, folder: String) -> void:
	if relighter_.setup(baked, texels, shadow_map_size, directional, folder):
		_texture.texture_rd_rid = relighter_.engine_map
		_begin.call_deferred(relighter_, baked.bounds)
	else:
		_fail.call_deferred("%s: %s" % [file, relighter_.error])


## On the render thread.
static func _frame(relighter_: LocalprtRelighter, lamps: Array[LocalprtLamp], emission: PackedFloat32Array, sky_: Array, n: int) -> void:
	relighter_.set_lamps(lamps)
	if not emission.is_empty():
		relighter_.set_emission(emission)
	if not sky_.is_empty():
		relighter_.set_sky(sky_[0])
	relighter_.bounces = n
	relighter_.frame()


func _begin(relighter_: LocalprtRelighter, bounds: AABB) -> void:
	if relighter_ != _relighter:
		return
	var data := LightmapGIData.new()
	var textures: Array[TextureLayered] = [_texture]
	data.lightmap_textures = textures
	data.set_uses_spherical_harmonics(relighter_.is_directional)
	# The encoding of directions that the engine's shaders read.
	data.set("_uses_packed_directional", relighter_.is_directional)
	_lightmap = LightmapGI.new()
	_lightmap.light_data = data
	_scene_root().add_child(_lightmap, false, INTERNAL_MODE_BACK)
	RenderingServer.lightmap_set_probe_bounds(data.get_rid(), bounds.grow(1.0))
	_sent_emission = PackedFloat32Array()
	_sent_sky = Vector3.ZERO
	_assign()
	_is_ready = true
	update()
	loaded.emit()


func _assign() -> void:
	_meshes.clear()
	_materials.clear()
	var data := _lightmap.light_data
	# The node forgets the users that it had and takes the new ones.
	_lightmap.light_data = null
	data.clear_users()
	for node in _scene_root().find_children("*", "MeshInstance3D", true, false):
		var mesh := node as MeshInstance3D
		if _has_light_map(mesh):
			_meshes.append(mesh)
			data.add_user(_lightmap.get_path_to(mesh), Rect2(0, 0, 1, 1), 0, -1)
			_take_materials(mesh)
	_lightmap.light_data = data


## Every surface has the coordinates.
static func _has_light_map(instance: MeshInstance3D) -> bool:
	var mesh := instance.mesh as ArrayMesh
	if mesh == null or mesh.get_surface_count() == 0:
		return false
	for surface in mesh.get_surface_count():
		if not mesh.surface_get_format(surface) & Mesh.ARRAY_FORMAT_TEX_UV2:
			return false
	return true


func _take_materials(instance: MeshInstance3D) -> void:
	for surface in instance.mesh.get_surface_count():
		var material := instance.get_active_material(surface) as BaseMaterial3D
		var own := instance.mesh.surface_get_material(surface)
		var name_of: Material = own if own else material
		var number := _material_names.find(name_of.resource_name) if name_of else -1
		if material and number >= 0:
			_materials[number] = material
			if number not in _first_emission:
				_first_emission[number] = _emitted(material)


func _scene_root() -> Node3D:
	return get_node(scene) as Node3D if scene else get_parent_node_3d()


func _lamps() -> Array[LocalprtLamp]:
	var root: Node = get_node(lights) if lights else get_tree().root
	var to_scene := _scene_root().global_transform.affine_inverse()
	var is_physical: bool = ProjectSettings.get_setting("rendering/lights_and_shadows/use_physical_light_units", false)
	var lamps: Array[LocalprtLamp] = []
	for light in _lights:
		if light.is_visible_in_tree() and (root == light or root.is_ancestor_of(light)):
			var lamp := LocalprtLamp.of(light, to_scene, is_physical)
			if lamp:
				lamps.append(lamp)
	return lamps


## Four numbers a material: radiance and 1 where it is another than at first, zeros where it is the scene's.
func _emission() -> PackedFloat32Array:
	var rows := PackedFloat32Array()
	rows.resize(4 * _material_names.size())
	for number: int in _materials:
		var radiance := _emitted(_materials[number])
		if radiance != _first_emission[number]:
			for band in 3:
				rows[4 * number + band] = radiance[band]
			rows[4 * number + 3] = 1.0
	return rows


static func _emitted(material: BaseMaterial3D) -> Vector3:
	if not material.emission_enabled:
		return Vector3.ZERO
	var color := material.emission.srgb_to_linear()
	var energy := material.emission_energy_multiplier
	if ProjectSettings.get_setting("rendering/lights_and_shadows/use_physical_light_units", false):
		energy *= material.emission_intensity
	return energy * Vector3(color.r, color.g, color.b)


func _sky_radiance() -> Vector3:
	var color := sky.srgb_to_linear()
	var energy := 1.0
	if sky_from_environment:
		var environment := get_world_3d().environment
		if environment == null:
			environment = get_world_3d().fallback_environment
		if environment == null or environment.background_mode != Environment.BG_COLOR:
			return Vector3.ZERO
		color = environment.background_color.srgb_to_linear()
		energy = environment.background_energy_multiplier
		if ProjectSettings.get_setting("rendering/lights_and_shadows/use_physical_light_units", false):
			energy *= environment.background_intensity
	return energy * Vector3(color.r, color.g, color.b)
