//! Cameras of Project Aria's glasses: calibrations, the sizes of their images, and images that were stood upright.

use std::f64::consts::FRAC_PI_2;
use std::path::Path;

use nalgebra::{Matrix3, Rotation3, UnitQuaternion};
use serde_json::Value;

use crate::error::{Error, Result};
use crate::import::axes;
use crate::import::capture::QuaternionOrder;
use crate::import::optics::{LensModel, Optics};
use crate::import::text::Lines;
use crate::math::{Pose, Vector};

/// The colour camera's name.
const COLOR: &str = "camera-rgb";
/// Columns and rows of the first glasses' colour sensor, which a calibration without sizes is of.
const SENSOR: usize = 2880;
/// Pixels that the glasses cut from each side of it before they shrink the image.
const BORDER: usize = 32;

/// A camera and its place on the glasses.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct Mounted {
    /// The camera.
    pub optics: Optics,
    /// Its place in the frame that trajectory and hands call `device`.
    pub device_from_camera: Pose,
}

impl Mounted {
    /// The camera of an image of a size: all of the sensor, or what is left of it once its border is cut.
    pub fn of_size(self, width: usize, height: usize) -> Self {
        let o = self.optics;
        let inner = SENSOR - 2 * BORDER;
        let is_cut =
            (o.width, o.height) == (SENSOR, SENSOR) && width == height && width > 0 && inner.is_multiple_of(width);
        let whole = if is_cut {
            Optics { width: inner, height: inner, cx: o.cx - BORDER as f64, cy: o.cy - BORDER as f64, ..o }
        } else {
            o
        };
        // An image of another shape is told where it is decoded.
        if !whole.has_shape(width, height) {
            return self;
        }
        Self { optics: whole.resized(width, height), ..self }
    }

    /// The same for images that were turned clockwise by a quarter: pixel (u, v) became (height - 1 - v, u).
    pub fn upright(self) -> Self {
        let o = self.optics;
        let lens = match o.lens {
            LensModel::FisheyeRadTanThinPrism { k, p: [p0, p1], s: [s0, s1, s2, s3] } => {
                LensModel::FisheyeRadTanThinPrism { k, p: [-p1, p0], s: [-s2, -s3, s0, s1] }
            }
            LensModel::OpenCv { k, p: [p1, p2] } => LensModel::OpenCv { k, p: [p2, -p1] },
            other @ (LensModel::Pinhole | LensModel::Fisheye { .. }) => other,
        };
        let optics = Optics {
            width: o.height,
            height: o.width,
            fx: o.fy,
            fy: o.fx,
            cx: o.height as f64 - 1.0 - o.cy,
            cy: o.cx,
            lens,
        };
        let turn = UnitQuaternion::from_scaled_axis(Vector::z() * -FRAC_PI_2);
        let device_from_camera = self.device_from_camera * Pose::from_parts(Vector::zeros().into(), turn);
        Self { optics, device_from_camera }
    }
}

/// The colour camera of `online_calibration.jsonl`: of its first line that has one, as later ones differ by fractions of a
/// millimetre.
///
/// # Errors
/// With the line where it is no such calibration.
pub(super) fn online(path: &Path) -> Result<Mounted> {
    let mut lines = Lines::open(path)?;
    while let Some(line) = lines.content()? {
        let json: Value = serde_json::from_str(&line)
            .map_err(|e| lines.fault(format!("is no JSON ({e}); was the file copied as a whole?")))?;
        let cameras = unquoted(&json["CameraCalibrations"]).map_err(|e| lines.fault(e))?;
        let Some(list) = cameras.as_array() else {
            return Err(lines.fault("has no list \"CameraCalibrations\"; is this MPS' online calibration?"));
        };
        let Some(index) = list.iter().position(|c| c["Label"] == COLOR) else { continue };
        let Some(camera) = list.get(index) else { continue };
        let sizes = numbers(&json["ImageSizes"][index]).ok();
        let size = match sizes.as_deref() {
            Some([w, h]) if *w >= 1.0 && *h >= 1.0 => [*w as usize, *h as usize],
            _ => [SENSOR; 2],
        };
        return mps_camera(camera, size).map_err(|e| lines.fault(format!("camera {COLOR}: {e}")));
    }
    Err(Error::format(path, "cameras", format!("no line has the camera {COLOR}")))
}

/// The colour camera of a file with one calibration, as HD-EPIC's tools and our exporter write it.
///
/// # Errors
/// With the key that is not what it should be.
pub(super) fn exported(path: &Path) -> Result<Mounted> {
    let json: Value = crate::json::read(path)?;
    let fault = |place: &str, message: String| Error::format(path, place, message);
    let size = |key: &str| match json[key].as_u64() {
        Some(n) if n > 0 => Ok(n as usize),
        _ => Err(fault(key, format!("expected a number of pixels, found {}", short(&json[key])))),
    };
    let size = [size("image_width")?, size("image_height")?];
    let params = numbers(&json["projection_params"]).map_err(|e| fault("projection_params", e))?;
    let model = json["model_name.name"].as_str().unwrap_or_default();
    let optics = projection(model, &params, size).map_err(|e| fault("projection_params", e))?;
    let key = "T_Device_Camera.mat3x4";
    let mut rows = Vec::new();
    for row in json[key].as_array().into_iter().flatten() {
        match row {
            Value::Array(_) => rows.extend(numbers(row).map_err(|e| fault(key, e))?),
            _ => rows.extend(row.as_f64()),
        }
    }
    let device_from_camera =
        rigid(&rows).ok_or_else(|| fault(key, "expected three rows of four numbers, a rigid transform".to_owned()))?;
    Ok(Mounted { optics, device_from_camera })
}

/// A camera of MPS' and VRS' calibrations.
fn mps_camera(json: &Value, size: [usize; 2]) -> std::result::Result<Mounted, String> {
    let model = json["Projection"]["Name"].as_str().unwrap_or_default();
    let params = numbers(&json["Projection"]["Params"])?;
    let optics = projection(model, &params, size)?;
    let place = &json["T_Device_Camera"];
    let (translation, imaginary) = (numbers(&place["Translation"])?, numbers(&place["UnitQuaternion"][1])?);
    let real = place["UnitQuaternion"][0].as_f64();
    let ([x, y, z], [i, j, k], Some(w)) = (translation.as_slice(), imaginary.as_slice(), real) else {
        return Err("T_Device_Camera: expected Translation [x, y, z] and UnitQuaternion [w, [x, y, z]]".to_owned());
    };
    let turn = axes::quaternion([w, *i, *j, *k], QuaternionOrder::Wxyz)
        .ok_or_else(|| "T_Device_Camera: UnitQuaternion has not the length 1".to_owned())?;
    Ok(Mounted { optics, device_from_camera: Pose::from_parts(Vector::new(*x, *y, *z).into(), turn) })
}

/// A camera of a model by the name that Project Aria's tools give it.
pub(super) fn projection(
    model: &str,
    params: &[f64],
    [width, height]: [usize; 2],
) -> std::result::Result<Optics, String> {
    let name = model.split(':').next().unwrap_or_default();
    let key: String = name.chars().filter(char::is_ascii_alphanumeric).map(|c| c.to_ascii_lowercase()).collect();
    let ([fx, fy, cx, cy], lens) = match (key.as_str(), params) {
        ("linear", [fx, fy, cx, cy]) => ([*fx, *fy, *cx, *cy], LensModel::Pinhole),
        ("kannalabrandtk3", [fx, fy, cx, cy, k0, k1, k2, k3]) => {
            ([*fx, *fy, *cx, *cy], LensModel::Fisheye { k: [*k0, *k1, *k2, *k3] })
        }
        ("fisheyeradtanthinprism" | "fisheye624", [f, cx, cy, rest @ ..]) if rest.len() == 12 => {
            ([*f, *f, *cx, *cy], prism(rest))
        }
        ("fisheyeradtanthinprism" | "fisheye624", [fx, fy, cx, cy, rest @ ..]) if rest.len() == 12 => {
            ([*fx, *fy, *cx, *cy], prism(rest))
        }
        ("fisheye62", [f, cx, cy, rest @ ..]) if rest.len() == 8 => ([*f, *f, *cx, *cy], prism(rest)),
        _ => {
            return Err(format!(
                "a lens \"{model}\" of {} numbers is none that is read (FisheyeRadTanThinPrism 15 or 16, Fisheye62 11, \
                 KannalaBrandtK3 8, Linear 4)",
                params.len()
            ));
        }
    };
    let optics = Optics { width, height, fx, fy, cx, cy, lens };
    optics.fault().map_or(Ok(optics), Err)
}

/// Six radial, two tangential and four thin prism coefficients; those that are not there are 0.
fn prism(rest: &[f64]) -> LensModel {
    let at = |i: usize| rest.get(i).copied().unwrap_or(0.0);
    LensModel::FisheyeRadTanThinPrism {
        k: std::array::from_fn(at),
        p: std::array::from_fn(|i| at(6 + i)),
        s: std::array::from_fn(|i| at(8 + i)),
    }
}

/// A rigid transform from the rows of a 3 x 4 matrix.
fn rigid(rows: &[f64]) -> Option<Pose> {
    let [a, b, c, x, d, e, f, y, g, h, i, z] = *rows else { return None };
    let m = Matrix3::new(a, b, c, d, e, f, g, h, i);
    let is_rotation = (m * m.transpose() - Matrix3::identity()).norm() < 0.01 && m.determinant() > 0.0;
    let turn = UnitQuaternion::from_rotation_matrix(&Rotation3::from_matrix_unchecked(m));
    is_rotation.then(|| Pose::from_parts(Vector::new(x, y, z).into(), turn))
}

/// Finite numbers of a list.
pub(super) fn numbers(json: &Value) -> std::result::Result<Vec<f64>, String> {
    let list = json.as_array().ok_or_else(|| format!("expected a list of numbers, found {}", short(json)))?;
    list.iter().map(|v| v.as_f64().ok_or_else(|| format!("expected a number, found {}", short(v)))).collect()
}

/// The start of a value, for messages.
fn short(json: &Value) -> String {
    if json.is_null() { "nothing".to_owned() } else { json.to_string().chars().take(40).collect() }
}

/// What a string holds, where Python's way to write a list stands in one (results before June 2023).
fn unquoted(json: &Value) -> std::result::Result<Value, String> {
    let Some(text) = json.as_str() else { return Ok(json.clone()) };
    let text = text.replace('\'', "\"").replace("True", "true").replace("False", "false").replace("None", "null");
    serde_json::from_str(&text).map_err(|e| format!("CameraCalibrations holds no JSON ({e})"))
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::math::Point;

    fn fisheye() -> Mounted {
        let params =
            [610.0, 715.0, 700.0, 0.4, -0.4, 0.15, 1.1, -1.6, 0.6, 0.0003, -0.0002, 0.001, -0.0001, -0.0004, 0.0001];
        Mounted {
            optics: projection("FisheyeRadTanThinPrism", &params, [1408, 1408]).unwrap(),
            device_from_camera: Pose::translation(0.01, 0.02, 0.03),
        }
    }

    #[test]
    fn an_image_that_was_stood_upright_shows_the_same_points() {
        let (raw, upright) = (fisheye(), fisheye().upright());
        for p in [Point::new(0.2, -0.4, 1.0), Point::new(-0.5, 0.1, 0.8), Point::new(0.0, 0.7, 0.9)] {
            let in_device = raw.device_from_camera * p;
            let (u, v) = raw.optics.project(&p).unwrap();
            let (x, y) = upright.optics.project(&(upright.device_from_camera.inverse() * in_device)).unwrap();
            assert!((x - (1407.0 - v)).abs() < 1e-9 && (y - u).abs() < 1e-9, "{u} {v}: {x} {y}");
        }
    }

    /// The glasses cut 32 pixels from each side of 2880 before they halve the image.
    #[test]
    fn shrunk_images_of_the_sensor_have_lost_their_border() {
        let o = fisheye().optics;
        let full = Mounted {
            optics: Optics { width: 2880, height: 2880, cx: 1440.0, cy: 1400.0, fx: 1220.0, ..o },
            ..fisheye()
        };
        let half = full.of_size(1408, 1408).optics;
        assert_eq!((half.width, half.fx), (1408, 610.0));
        assert!((half.cx - (1408.0 + 0.5) * 0.5 + 0.5).abs() < 1e-9, "{}", half.cx);
        let plain = full.of_size(1440, 1440).optics;
        assert_eq!((plain.width, plain.fx), (1440, 610.0));
        assert_eq!(full.of_size(1440, 1000).optics, full.optics);
    }

    #[test]
    fn lenses_have_the_numbers_of_their_models() {
        assert_eq!(projection("Linear:fu,fv,u0,v0", &[1.5, 2.0, 3.0, 4.0], [8, 8]).unwrap().fy, 2.0);
        assert!(projection("KANNALA_BRANDT_K3", &[9.0; 8], [8, 8]).unwrap().is_fisheye());
        for (model, count) in [("FISHEYE624", 14), ("Spherical", 4), ("", 0)] {
            let error = projection(model, &vec![9.0; count], [8, 8]).unwrap_err();
            assert!(error.contains("none that is read"), "{error}");
        }
    }
}
