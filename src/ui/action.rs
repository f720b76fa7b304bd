//! What a user can do, as plain data.

use crate::camera::Axis;
use crate::field::FieldSelector;
use crate::look::EnsembleChoice;
use crate::optics::OpticsKind;
use crate::pipeline::{Backend, RenderMode, SurfaceLook};
use crate::playback::Command;
use crate::playback::quality::Family;
use crate::transfer::{ColorMap, OpacityPoint, RangePolicy};
use glam::DVec2;

/// Something done by a key, the mouse or a widget.
#[derive(Clone, Debug, PartialEq)]
pub enum Action {
    /// To the clock.
    Play(Command),
    /// One notch faster.
    Faster,
    /// One notch slower.
    Slower,
    /// The next kind of loop: off, all, range.
    NextLoop,
    /// Ping-pong, or no loop.
    TogglePingPong,
    /// Real time, which drops frames where it must, or every step.
    ToggleDropping,
    /// What is played begins with the step shown.
    RangeFromHere,
    /// What is played ends with the step shown.
    RangeToHere,
    /// The camera around its focal point, in heights of the image (x to the right, y upwards).
    Orbit(DVec2),
    /// What is seen shifts by so much, in plane coordinates (half heights of the image; see
    /// [`Camera::pan`](crate::camera::Camera::pan)).
    Pan(DVec2),
    /// What is at `cursor` (plane coordinates) becomes `factor` times as large.
    Zoom {
        /// Above 1: larger.
        factor: f64,
        /// What stays where it is.
        cursor: DVec2,
    },
    /// The camera of the beginning.
    ResetView,
    /// Along an axis.
    ViewAlong {
        /// Which.
        axis: Axis,
        /// From its positive end.
        from_positive: bool,
    },
    /// Parallel projection, or perspective.
    OtherProjection,
    /// Ensembles of the project, or those of its timeline again and with them its levels of detail and optics.
    Ensembles(EnsembleChoice),
    /// Whether the camera goes along the path of the project.
    CameraPath(bool),
    /// Another field of the store.
    Field(FieldSelector),
    /// Other colours.
    Colors(ColorMap),
    /// Other opacities, as fractions of the range.
    Opacities(Vec<OpacityPoint>),
    /// Where the range of the colours comes from.
    Range(RangePolicy),
    /// Display-referred colour behind the volume.
    Background([f32; 3]),
    /// Where frames are rendered.
    Backend(Backend),
    /// Which renderer.
    Renderer(RenderMode),
    /// Draw this share of the interior faces, 0 to 1, where faces are drawn.
    LevelOfDetail(f64),
    /// How segments of a ray are integrated.
    Optics(OpticsKind),
    /// Isosurfaces, their light, and whether the volume is shown.
    Surfaces(SurfaceLook),
    /// The next of volume, surfaces and both.
    NextShown,
    /// The last isosurface by so many hundredths of the field's range.
    MoveIsovalue(f64),
    /// The last cut along its normal, as far as the mouse has moved, in heights of the image (x to the right, y upwards).
    MoveCut(DVec2),
    /// Frames per second that are aimed at while something moves; `None`: all frames are drawn in full.
    TargetRate(Option<f64>),
    /// What is given up for that; `None`: what costs least.
    GiveUp(Option<Family>),
    /// Pixels of the image per pixel of the screen, along a side.
    ImageScale(f64),
    /// The mouse is at this place of the picture, as shares of width and height from the left upper corner.
    PointAt(Option<(f64, f64)>),
    /// The point under the mouse: its value over the series is wanted.
    Pick,
    /// That point is forgotten.
    ForgetPick,
    /// What is on the screen, to a PNG file.
    Screenshot,
    /// Shows the help, or hides it.
    Help,
    /// A message has been read.
    Dismiss(usize),
}
