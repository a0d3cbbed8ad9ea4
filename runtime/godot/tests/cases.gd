extends RefCounted
## Lights for the example's scene, each with the same as a lighting file.

## The lamp of the box, and where it goes.
const LAMP := Vector3(0, 1.5, 0)
const MOVED := Vector3(0.5, 0.6, 0.4)
const CANDELA := 2.25
const NAMES: PackedStringArray = ["lamp", "moved", "spot", "sun", "many", "emission", "sky"]

## Farther than the window of a range can be seen.
const FAR := 30.0


## Changes the example's lights to those of a case; gives them as a lighting.
static func apply(name: String, example: Node3D) -> Dictionary:
	var lamp: OmniLight3D = example.lamp
	var hall: Node3D = example.hall
	match name:
		"moved":
			lamp.position = MOVED
			return { lights = [_point(MOVED, CANDELA)] }
		"spot":
			var spot := SpotLight3D.new()
			spot.light_energy = 6.0 / PI
			spot.light_color = Color(1.0, 0.246201, 0.057805).linear_to_srgb()
			spot.spot_range = FAR
			spot.spot_attenuation = 2.0
			spot.spot_angle = rad_to_deg(0.5)
			spot.spot_angle_attenuation = 1.0 / 8.0
			spot.shadow_enabled = true
			hall.add_child(spot)
			spot.look_at_from_position(Vector3(-0.6, 1.6, 0.6), Vector3(0.5, 0.0, -0.5))
			lamp.hide()
			# The edge that has the power of 1 - t^8, t from the axis to the edge: 5/6 of the way is the full light.
			var inner := acos(1.0 - 5.0 / 6.0 * (1.0 - cos(0.5)))
			return { lights = [{
				type = "spot", position = [-0.6, 1.6, 0.6], direction = [1.1, -1.6, -1.1], color = [1.0, 0.246201, 0.057805],
				intensity = 6.0, inner_cone = inner, outer_cone = 0.5,
			}] }
		"sun":
			var sun := DirectionalLight3D.new()
			sun.light_energy = 2.0 / PI
			sun.shadow_enabled = true
			sun.directional_shadow_mode = DirectionalLight3D.SHADOW_ORTHOGONAL
			sun.directional_shadow_max_distance = 10.0
			hall.add_child(sun)
			sun.look_at_from_position(Vector3(0.5, 1.0, 2.0), Vector3.ZERO)
			lamp.hide()
			return { lights = [{ type = "directional", direction = [-0.5, -1.0, -2.0], intensity = 2.0 }] }
		"many":
			# Twelve views and one: more than there are layers.
			var second := OmniLight3D.new()
			second.omni_range = FAR
			second.omni_attenuation = 2.0
			second.light_energy = 1.0 / PI
			second.light_color = Color(0.2, 0.5, 1.0).linear_to_srgb()
			second.shadow_enabled = true
			second.position = Vector3(-0.6, 0.9, 0.6)
			hall.add_child(second)
			var lighting := apply("sun", example)
			lamp.show()
			lighting.lights = [_point(LAMP, CANDELA), lighting.lights[0], _point(second.position, 1.0, [0.2, 0.5, 1.0])]
			return lighting
		"emission":
			var red: StandardMaterial3D = example.material("red")
			red.emission_enabled = true
			red.emission = Color(0.4, 0.1, 0.1).linear_to_srgb()
			return { materials = { red = { emission = [0.4, 0.1, 0.1] } } }
		"sky":
			var environment: Environment = example.get_node("WorldEnvironment").environment
			environment.background_color = Color(0.1, 0.2, 0.4).linear_to_srgb()
			lamp.hide()
			return { lights = [], sky = { type = "constant", radiance = [0.1, 0.2, 0.4] } }
	return {}


## Resources are shared by all instances: as they were.
static func restore(example: Node3D) -> void:
	example.get_node("WorldEnvironment").environment.background_color = Color.BLACK
	example.material("red").emission_enabled = false


static func _point(at: Vector3, intensity: float, color := [1.0, 1.0, 1.0]) -> Dictionary:
	return { type = "point", position = [at.x, at.y, at.z], intensity = intensity, color = color }
