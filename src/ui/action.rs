//! User actions, as plain data.

use super::camera_history::CameraTurn;
use super::exporting::ExportAction;
use crate::camera::Axis;
use crate::field::FieldSelector;
use crate::look::{EnsembleChoice, FlowLook};
use crate::optics::OpticsKind;
use crate::pipeline::{Backend, RenderMode, Representation, Sampling, SurfaceLook};
use crate::playback::Command;
use crate::playback::quality::Family;
use crate::project::Edit;
use crate::render::points::PointStyle;
use crate::render::surfaces::ByField;
use crate::transfer::{ColorMap, OpacityKind, OpacityPoint, RangePolicy};
use crate::ui::tracks::KeyAction;
use crate::ui::views::ViewAction;
use glam::DVec2;
use std::path::PathBuf;

/// A format of a file of one transfer function.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum FunctionFile {
    /// That of this program, which has all of it.
    Tetreel,
    /// ParaView's, with colours and opacities.
    ParaView,
}

/// An action triggered by a key, the mouse or a widget.
#[derive(Clone, Debug, PartialEq)]
pub enum Action {
    /// Sends a command to the clock.
    Play(Command),
    /// Raises the speed by one notch.
    Faster,
    /// Lowers the speed by one notch.
    Slower,
    /// Switches to the next kind of loop: off, all, range.
    NextLoop,
    /// Switches between ping-pong and no loop.
    TogglePingPong,
    /// Switches between real time, which may drop frames, and every step.
    ToggleDropping,
    /// Starts the played range at the step shown.
    RangeFromHere,
    /// Ends the played range at the step shown.
    RangeToHere,
    /// Orbits the camera around its focal point, in heights of the image (x to the right, y upwards).
    Orbit(DVec2),
    /// Shifts the image, in plane coordinates (half heights of the image; see [`Camera::pan`](crate::camera::Camera::pan)).
    Pan(DVec2),
    /// Magnifies by `factor` around `cursor` (plane coordinates).
    Zoom {
        /// Above 1: larger.
        factor: f64,
        /// The fixed point.
        cursor: DVec2,
    },
    /// Restores the initial camera.
    ResetView,
    /// Looks along an axis.
    ViewAlong {
        /// The axis.
        axis: Axis,
        /// Whether to look from its positive end.
        from_positive: bool,
    },
    /// Switches between parallel and perspective projection.
    OtherProjection,
    /// Returns to the camera before the last movement, or to the one that was left by that.
    TurnCamera(CameraTurn),
    /// Looks through the named camera of this index, from 0.
    GoToCamera(usize),
    /// Shows ensembles of the project, or those of its timeline again and with them its levels of detail and optics.
    Ensembles(EnsembleChoice),
    /// Sets whether the camera follows the project's path.
    CameraPath(bool),
    /// Shows another field of the store.
    Field(FieldSelector),
    /// Changes the project.
    Edit(Box<Edit>),
    /// Selects or changes keys of the timeline.
    Keys(KeyAction),
    /// Undoes the last change of what is shown.
    Undo,
    /// Does the change again that was undone last.
    Redo,
    /// Saves what is shown as a project, to its file or to this one.
    SaveProject {
        /// The file; `None`: the one that it has.
        to: Option<PathBuf>,
        /// Whether a file that is there is replaced; its own one always is.
        may_replace: bool,
    },
    /// Edits the member of this index, from 0.
    Member(usize),
    /// Sets the colour map of the edited member.
    Colors(ColorMap),
    /// Sets the opacities of the edited member, at fractions of the range.
    Opacities(Vec<OpacityPoint>),
    /// Gives the edited member the transfer function of a file, or its colours, as `--tf` reads them.
    LoadFunction {
        /// The file; `FILE.json#NAME` for one of several colour maps.
        from: PathBuf,
        /// Whether opacities stay as they are.
        colors_only: bool,
    },
    /// Writes the transfer function of the edited member to a file.
    SaveFunction {
        /// The file.
        to: PathBuf,
        /// Its format.
        format: FunctionFile,
        /// Whether a file that is there is replaced.
        may_replace: bool,
    },
    /// Sets what opacities mean.
    OpacityKind(OpacityKind),
    /// Sets the length that opacities refer to.
    UnitDistance(f64),
    /// Sets how the range of the edited member is found.
    Range(RangePolicy),
    /// Sets the display-referred colour behind the volume.
    Background([f32; 3]),
    /// Sets the device that renders.
    Backend(Backend),
    /// Sets the renderer.
    Renderer(RenderMode),
    /// Sets what the reference draws.
    Representation(Representation),
    /// Sets the share to draw, 0 to 1: of interior faces, or of the fragments of points.
    LevelOfDetail(f64),
    /// Sets which faces are drawn, for face renderers.
    Sampling(Sampling),
    /// Sets how cells are drawn as points; their level of detail is that of [`Self::LevelOfDetail`]. An invalid radius is not applied.
    Points(PointStyle),
    /// Sets how segments of a ray are integrated.
    Optics(OpticsKind),
    /// Sets isosurfaces, their light, and whether the volume is shown.
    Surfaces(Box<SurfaceLook>),
    /// Shows the next of volume, surfaces and both.
    NextShown,
    /// Shows the flow of a field of vectors, or none. An invalid style or rate is not applied.
    Flow(Option<Box<FlowLook>>),
    /// Shows the flow with an opacity, 0 to 1, at all times.
    FlowOpacity(f64),
    /// Colours the flow by a field, or by none.
    FlowColors(Option<ByField>),
    /// Shows flow or hides it.
    ToggleFlow,
    /// Shows the next icon of flow.
    NextIcon,
    /// Moves the last isosurface by hundredths of the field's range.
    MoveIsovalue(f64),
    /// Moves the last cut along its normal by a movement of the mouse, in heights of the image (x to the right, y upwards).
    MoveCut(DVec2),
    /// Sets the target frame rate while something moves; `None`: all frames are drawn in full.
    TargetRate(Option<f64>),
    /// Draws less while something moves: the target frame rate is a notch higher.
    LessQuality,
    /// Draws more while something moves: the target frame rate is a notch lower, or all frames are drawn in full.
    MoreQuality,
    /// Sets the family of lower qualities for that; `None`: the one with the least error.
    GiveUp(Option<Family>),
    /// Sets pixels of the image per pixel of the screen, along a side.
    ImageScale(f64),
    /// Moves the mouse to this position in the picture, as shares of width and height from the top left corner.
    PointAt(Option<(f64, f64)>),
    /// Picks the point under the mouse, to plot its value over the series.
    Pick,
    /// Forgets the picked point.
    ForgetPick,
    /// Saves the picture on the screen to a PNG file.
    Screenshot,
    /// Exports images or a movie.
    Export(ExportAction),
    /// Shows the help, or hides it.
    Help,
    /// Fills the screen with the window, or no longer.
    Fullscreen,
    /// Closes the help; else dismisses the last message, or else forgets the picked point.
    Close,
    /// Returns to what was saved last, or with which the window was opened; that can be undone.
    Revert,
    /// Dismisses a message.
    Dismiss(usize),
    /// Arranges two views, where there are two ([`Views`](crate::ui::views::Views)); a view alone does nothing.
    View(ViewAction),
}
