//! Soft shadows on the floor around what stands on it.

use multiversion::multiversion;

use super::buffer::Window;

/// A round shadow, darkest in the middle.
pub struct Shadow {
    /// Its middle, to the right of the camera [m].
    pub across: f32,
    /// Its middle, ahead of the camera [m].
    pub ahead: f32,
    /// Square of its radius [m²].
    pub radius2: f32,
    /// Share of the brightness that its middle loses.
    pub strength: f32,
}

/// A grey picture of a room of `columns.len()` columns.
pub struct Room<'a> {
    /// Brightness of every pixel.
    pub grey: &'a mut [u8],
    /// Of every pixel [m].
    pub depth: &'a [f32],
    /// Of the floor in every row [m].
    pub floor: &'a [f32],
    /// How far to the right a column's ray goes for every metre ahead.
    pub columns: &'a [f32],
}

impl Shadow {
    /// Darkens the floor within a window of the picture.
    pub fn fall(&self, room: Room<'_>, window: Window) {
        fall(self, room, window);
    }
}

#[multiversion(targets("x86_64+avx2+fma"))]
fn fall<'a>(shadow: &Shadow, room: Room<'a>, [left, top, right, bottom]: Window) {
    let columns = &room.columns[left..right];
    for row in top..bottom {
        let at = row * room.columns.len() + left..row * room.columns.len() + right;
        let floor = room.floor[row];
        let beyond = (floor - shadow.ahead) * (floor - shadow.ahead);
        let least = floor * 0.999;
        for ((grey, &depth), &column) in room.grey[at.clone()].iter_mut().zip(&room.depth[at]).zip(columns) {
            let aside = floor * column - shadow.across;
            let gap = aside * aside + beyond;
            let dark = if depth >= least { (1.0 - gap / shadow.radius2).max(0.0) } else { 0.0 };
            *grey = (f32::from(*grey) * (1.0 - shadow.strength * dark)).round_ties_even() as u8;
        }
    }
}
