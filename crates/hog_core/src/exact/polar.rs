//! Magnitude and angle of gradients, as OpenCV's `cartToPolar` rounds them.
//!
//! OpenCV fuses multiply and add where the CPU can, and rounds twice where it cannot; so does this.

use super::isa::MulAdd;

/// Degrees of the odd polynomial that stands for the arctangent on 0..=1.
const DEGREES: f32 = (180.0 / std::f64::consts::PI) as f32;
pub const P1: f32 = 0.9997878412794807_f64 as f32 * DEGREES;
pub const P3: f32 = -0.3258083974640975_f64 as f32 * DEGREES;
pub const P5: f32 = 0.1555786518463281_f64 as f32 * DEGREES;
pub const P7: f32 = -0.04432655554792128_f64 as f32 * DEGREES;
/// Keeps a gradient of 0 from 0 / 0.
pub const TINY: f32 = f64::EPSILON as f32;
pub const RADIANS: f32 = (std::f64::consts::PI / 180.0) as f32;

/// Turns gradients (`dx`, `dy`) into magnitude and angle [0, 2π], in their places; both of one length.
///
/// `vector_rule` says how angles beyond 45° are rounded: as OpenCV's vector code does, or as its scalar code does.
#[inline(always)]
pub(super) fn polar<M: MulAdd>(dx: &mut [f32], dy: &mut [f32], vector_rule: bool) {
    let gradients = dx.iter_mut().zip(dy);
    if vector_rule {
        gradients.for_each(|(dx, dy)| (*dx, *dy) = polar_of::<M, true>(*dx, *dy));
    } else {
        gradients.for_each(|(dx, dy)| (*dx, *dy) = polar_of::<M, false>(*dx, *dy));
    }
}

#[inline(always)]
fn polar_of<M: MulAdd, const VECTOR_RULE: bool>(dx: f32, dy: f32) -> (f32, f32) {
    let magnitude = M::mul_add(dx, dx, dy * dy).sqrt();
    let (ax, ay) = (dx.abs(), dy.abs());
    let steep = ax < ay;
    let (short, long) = if steep { (ax, ay) } else { (ay, ax) };
    let c = short / (long + TINY);
    let cc = c * c;
    let t = M::mul_add(M::mul_add(M::mul_add(cc, P7, P5), cc, P3), cc, P1);
    let flat = t * c;
    let beyond_45 = if VECTOR_RULE { 90.0 - flat } else { M::mul_add(-t, c, 90.0) };
    let mut degrees = if steep { beyond_45 } else { flat };
    degrees = if dx < 0.0 { 180.0 - degrees } else { degrees };
    degrees = if dy < 0.0 { 360.0 - degrees } else { degrees };
    (magnitude, degrees * RADIANS)
}

#[cfg(test)]
mod tests {
    use super::super::isa::{Fused, Separate};
    use super::*;

    #[test]
    fn the_angle_is_within_two_hundredths_of_a_degree_of_the_arctangent() {
        let turn: Vec<f64> = (0..720).map(|i| f64::from(i).to_radians() / 2.0).collect();
        let dx: Vec<f32> = turn.iter().map(|a| (7.0 * a.cos()) as f32).collect();
        let dy: Vec<f32> = turn.iter().map(|a| (7.0 * a.sin()) as f32).collect();
        for vector_rule in [true, false] {
            let (mut magnitude, mut angle) = (dx.clone(), dy.clone());
            polar::<Fused>(&mut magnitude, &mut angle, vector_rule);
            for (i, &expected) in turn.iter().enumerate() {
                let off = (f64::from(angle[i]) - expected).abs();
                let off = off.min(2.0 * std::f64::consts::PI - off);
                assert!(off < 0.02_f64.to_radians(), "{i}: {off}");
                assert!((magnitude[i] - 7.0).abs() < 1e-5);
            }
        }
    }

    #[test]
    fn steep_angles_are_rounded_as_opencvs_vector_code_and_its_scalar_code_round_them() {
        // cv2.cartToPolar 4.14 with fused multiply-add, of 16 equal gradients and of three: bits of the angles.
        let recorded = [
            ((2.0, 185.0), 0x3fc7_adb1, 0x3fc7_adb2),
            ((3.0, 60.0), 0x3fc2_ab23, 0x3fc2_ab22),
            ((4.0, 33.0), 0x3fb9_9fb2, 0x3fb9_9fb3),
            ((6.0, 28.0), 0x3fae_0a68, 0x3fae_0a67),
            ((6.0, 119.0), 0x3fc2_9d67, 0x3fc2_9d68),
        ];
        for ((dx, dy), vector, scalar) in recorded {
            for (vector_rule, wanted) in [(true, vector), (false, scalar)] {
                let (mut magnitude, mut angle) = ([dx], [dy]);
                polar::<Fused>(&mut magnitude, &mut angle, vector_rule);
                assert_eq!(angle[0].to_bits(), wanted, "{dx} {dy} {vector_rule}");
            }
        }
    }

    #[test]
    fn no_gradient_has_angle_and_magnitude_zero() {
        let (mut magnitude, mut angle) = ([0.0], [0.0]);
        polar::<Separate>(&mut magnitude, &mut angle, true);
        assert_eq!((magnitude, angle), ([0.0], [0.0]));
    }
}
