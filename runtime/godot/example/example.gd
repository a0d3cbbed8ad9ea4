extends Node3D
## A lamp to drag in the Cornell box; the red wall glows while the space bar is down.

const SCENE := "res://cornell.glb"
## glTF tells candela; an energy of 1 is pi of them.
const ENERGY_PER_CANDELA := 1.0 / PI
const GLOW := Color(0.4, 0.1, 0.1)

@onready var hall: Node3D = $Hall
@onready var localprt: Localprt = $Hall/Localprt
var lamp: OmniLight3D
var camera: Camera3D

var _is_dragging := false


func _ready() -> void:
	var scene := (load(SCENE) as PackedScene).instantiate()
	hall.add_child(scene)
	camera = scene.find_children("*", "Camera3D", true, false)[0]
	camera.current = true
	lamp = scene.find_children("*", "OmniLight3D", true, false)[0]
	lamp.light_energy *= ENERGY_PER_CANDELA
	lamp.omni_attenuation = 2.0
	# A lamp of a glTF without a range comes in with 4096 metres, too far for shadows of what is near it.
	lamp.omni_range = 30.0
	lamp.shadow_enabled = true
	# The box is small.
	lamp.shadow_bias = 0.02
	lamp.shadow_normal_bias = 0.3
	for node in hall.find_children("*", "MeshInstance3D", true, false):
		# Walls are single sheets.
		node.cast_shadow = GeometryInstance3D.SHADOW_CASTING_SETTING_DOUBLE_SIDED
	for material in materials():
		# What the bake knows of surfaces: as much light to all sides.
		material.diffuse_mode = BaseMaterial3D.DIFFUSE_LAMBERT
		material.specular_mode = BaseMaterial3D.SPECULAR_DISABLED


func _unhandled_input(event: InputEvent) -> void:
	if event is InputEventMouseButton and event.button_index == MOUSE_BUTTON_LEFT:
		_is_dragging = event.pressed
	elif event is InputEventMouseMotion and _is_dragging:
		var depth := -(camera.global_transform.affine_inverse() * lamp.global_position).z
		lamp.global_position = camera.project_position(event.position, depth)
	elif event is InputEventKey and event.keycode == KEY_SPACE and not event.echo:
		var red := material("red")
		red.emission_enabled = event.pressed
		red.emission = GLOW.linear_to_srgb()


## Materials of the scene.
func materials() -> Array[StandardMaterial3D]:
	var found: Array[StandardMaterial3D] = []
	for node in hall.find_children("*", "MeshInstance3D", true, false):
		for surface in node.mesh.get_surface_count():
			var of_surface := node.mesh.surface_get_material(surface) as StandardMaterial3D
			if of_surface and of_surface not in found:
				found.append(of_surface)
	return found


## One of them by its name.
func material(of_name: String) -> StandardMaterial3D:
	for of_scene in materials():
		if of_scene.resource_name == of_name:
			return of_scene
	return null
