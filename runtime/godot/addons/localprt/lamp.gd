class_name LocalprtLamp
extends RefCounted
## A light in the terms of the passes: candela or lux, scene space. Made of the engine's lights; told to the shaders as records.

enum { POINT, SPOT, DIRECTIONAL }

const BYTES := 64
const VIEW_BYTES := 80
## Half angle up to which a spot has one map, and the border of a map, as in the runtime's views.rs.
const MOST_SPOT_ANGLE := 1.22
const BORDER_TEXELS := 4.0

var kind := POINT
var position := Vector3.ZERO
## In which the light travels.
var direction := Vector3.FORWARD
## Linear color times intensity.
var emitted := Vector3.ZERO
var distance := 0.0
var inner_cone := 0.0
var outer_cone := 0.0


## Of a light of the engine; null if it gives no bounced light.
##
## An energy of 1 is pi candela, or pi lux, which a white surface turns into radiance 1 one metre away; with physical light units it is
## the light's lumens or lux. The engine's falloff is taken as that of light, its exponents as 2.
static func of(light: Light3D, to_scene: Transform3D, is_physical: bool) -> LocalprtLamp:
	if light.light_bake_mode == Light3D.BAKE_DISABLED or light.light_negative:
		return null
	var lamp := LocalprtLamp.new()
	var place := to_scene * light.global_transform
	lamp.position = place.origin
	lamp.direction = -place.basis.z.normalized()
	var energy := light.light_energy * light.light_indirect_energy
	if light is OmniLight3D:
		energy *= _candela(light, is_physical, 4.0 * PI)
		lamp.distance = light.omni_range
	elif light is SpotLight3D:
		energy *= _candela(light, is_physical, PI)
		lamp.kind = SPOT
		lamp.distance = light.spot_range
		energy *= lamp._fit_cone(deg_to_rad(light.spot_angle), light.spot_angle_attenuation)
	elif light is DirectionalLight3D:
		energy *= light.light_intensity_lux if is_physical else PI
		lamp.kind = DIRECTIONAL
	else:
		return null
	var color := light.light_color.srgb_to_linear()
	lamp.emitted = energy * Vector3(color.r, color.g, color.b)
	var is_dark := maxf(lamp.emitted.x, maxf(lamp.emitted.y, lamp.emitted.z)) <= 0.0
	return null if is_dark or not lamp.emitted.is_finite() or not lamp.position.is_finite() else lamp


static func _candela(light: Light3D, is_physical: bool, lumens_per_candela: float) -> float:
	return light.light_intensity_lumens / lumens_per_candela if is_physical else PI


## A cone whose edge is a squared ramp, as in glTF, with the power of the engine's, 1 - t^(1 / attenuation) with t from the axis to the
## edge. A factor for cones too soft for that.
func _fit_cone(angle: float, attenuation: float) -> float:
	var share := 1.0 / (1.0 + attenuation)
	var core := maxf((3.0 * share - 1.0) / 2.0, 0.0)
	outer_cone = minf(angle, PI / 2.0)
	inner_cone = acos(1.0 - core * (1.0 - cos(outer_cone)))
	return minf(3.0 * share, 1.0)


## `Light` of direct_light.wgsl.
func record(first_view: int, n_views: int) -> PackedByteArray:
	var scale := 0.0
	var offset := 1.0
	if kind == SPOT:
		scale = 1.0 / maxf(cos(inner_cone) - cos(outer_cone), 0.001)
		offset = -cos(outer_cone) * scale
	var floats := PackedFloat32Array([
		position.x, position.y, position.z, 1.0 / distance if distance > 0.0 else 0.0,
		direction.x, direction.y, direction.z, scale, emitted.x, emitted.y, emitted.z, offset,
	])
	var bytes := floats.to_byte_array()
	bytes.append_array(PackedInt32Array([1 if kind == DIRECTIONAL else 0, first_view, n_views, 0]).to_byte_array())
	return bytes


## `ShadowView`s of shadow_view.wgsl: one, or six faces in the order +x, -x, +y, -y, +z, -z.
func views(low: Vector3, high: Vector3, rounding_m: float, map_size: int) -> Array[PackedByteArray]:
	var inner := 1.0 - 2.0 * BORDER_TEXELS / map_size
	var near := rounding_m if rounding_m > 0.0 else 1.0
	if kind == DIRECTIONAL:
		return [_parallel(low, high, near, inner)]
	if kind == SPOT and outer_cone <= MOST_SPOT_ANGLE:
		return [_perspective(direction, tan(maxf(outer_cone, 0.001)), near, inner)]
	var faces: Array[PackedByteArray] = []
	for axis: Vector3 in [Vector3.RIGHT, Vector3.UP, Vector3.BACK]:
		faces.append(_perspective(axis, 1.0, near, inner))
		faces.append(_perspective(-axis, 1.0, near, inner))
	return faces


func _parallel(low: Vector3, high: Vector3, pad: float, inner: float) -> PackedByteArray:
	var axes := _frame(direction)
	var half := (high - low) / 2.0
	var reach := func(axis: Vector3) -> float: return axis.abs().dot(half) + pad
	var scale := Vector2(inner / reach.call(axes[0]), inner / reach.call(axes[1]))
	return _view((low + high) / 2.0, axes, direction, scale, [0.5, -0.5 / reach.call(direction), 1.0, 0.0])


func _perspective(forward: Vector3, tangent: float, near: float, inner: float) -> PackedByteArray:
	return _view(position, _frame(forward), forward, Vector2.ONE * inner / tangent, [near, 0.0, 0.0, 1.0])


static func _view(origin: Vector3, axes: Array[Vector3], forward: Vector3, scale: Vector2, depth_w: Array) -> PackedByteArray:
	return PackedFloat32Array([
		origin.x, origin.y, origin.z, scale.x, axes[0].x, axes[0].y, axes[0].z, scale.y,
		axes[1].x, axes[1].y, axes[1].z, depth_w[0], forward.x, forward.y, forward.z, depth_w[1],
		depth_w[2], depth_w[3], 0.0, 0.0,
	]).to_byte_array()


## Two unit vectors across a third (Duff et al. 2017).
static func _frame(n: Vector3) -> Array[Vector3]:
	var sign_z := -1.0 if n.z < 0.0 else 1.0
	var a := -1.0 / (sign_z + n.z)
	var b := n.x * n.y * a
	return [Vector3(1.0 + sign_z * n.x * n.x * a, sign_z * b, -sign_z * n.x), Vector3(b, sign_z + n.y * n.y * a, -n.y)]
