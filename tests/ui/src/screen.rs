//! A screen in memory (Xvfb), and a user in front of it: keys, mouse and eyes, all through X, as for any program.

use std::io::{BufRead, BufReader};
use std::process::{Child, Command, ExitStatus, Stdio};
use std::time::Duration;
use x11rb::connection::Connection;
use x11rb::protocol::xproto::{
    BUTTON_PRESS_EVENT, BUTTON_RELEASE_EVENT, ConnectionExt as _, ImageFormat, InputFocus, KEY_PRESS_EVENT,
    KEY_RELEASE_EVENT, MOTION_NOTIFY_EVENT,
};
use x11rb::protocol::xtest::ConnectionExt as _;
use x11rb::rust_connection::RustConnection;

/// A screen that ends with its owner.
#[derive(Debug)]
pub struct Screen {
    server: Child,
    /// As `DISPLAY` has it.
    pub name: String,
}

impl Screen {
    /// Starts a screen of so many pixels.
    ///
    /// # Errors
    /// If there is no Xvfb, or it does not come up.
    pub fn start(width: u32, height: u32) -> Result<Self, String> {
        // It says on its standard output which number it took.
        let size = format!("{width}x{height}x24");
        let arguments = ["-displayfd", "1", "-screen", "0", &size, "-nolisten", "tcp", "-noreset"];
        let mut command = Command::new("Xvfb");
        command.args(arguments).stdin(Stdio::null()).stdout(Stdio::piped()).stderr(Stdio::null());
        let mut server = command.spawn().map_err(|error| format!("cannot start Xvfb: {error}"))?;
        let mut number = String::new();
        let output = server.stdout.take().ok_or("Xvfb has no output")?;
        BufReader::new(output).read_line(&mut number).map_err(|error| error.to_string())?;
        let name = format!(":{}", number.trim());
        match number.trim().parse::<u32>() {
            Ok(_) => Ok(Self { server, name }),
            Err(_) => {
                let _ = server.kill();
                let _ = server.wait();
                Err("Xvfb did not start".to_owned())
            }
        }
    }
}

impl Drop for Screen {
    fn drop(&mut self) {
        let _ = self.server.kill();
        let _ = self.server.wait();
    }
}

/// Tells the process that shows the window from the one that has started the screen.
const IN_FRONT: &str = "TETREEL_TEST_WINDOW";

/// Runs this program again, with the same arguments, on a screen of so many pixels. `None` in the program that runs there: it
/// goes on. The screen is named in the environment, which a program should not change while it runs.
///
/// # Errors
/// If there is no screen, or the program cannot be run.
pub fn on_a_screen((width, height): (u32, u32)) -> Result<Option<ExitStatus>, String> {
    if std::env::var_os(IN_FRONT).is_some() {
        return Ok(None);
    }
    let screen = Screen::start(width, height)?;
    let program = std::env::current_exe().map_err(|error| error.to_string())?;
    let mut window = Command::new(program);
    window.args(std::env::args_os().skip(1)).env(IN_FRONT, "1");
    window.env("DISPLAY", &screen.name).env_remove("WAYLAND_DISPLAY");
    window.status().map(Some).map_err(|error| error.to_string())
}

/// Keys by their names in X.
#[derive(Clone, Copy, Debug)]
pub struct Keysym(pub u32);

impl Keysym {
    /// The space bar.
    pub const SPACE: Self = Self(0x20);
    /// The letter s.
    pub const S: Self = Self(0x73);
    /// Arrow to the right.
    pub const RIGHT: Self = Self(0xff53);
    /// To the beginning.
    pub const HOME: Self = Self(0xff50);
}

/// Hands and eyes.
pub struct User {
    connection: RustConnection,
    root: u32,
    /// Keysyms of the first keycode on, so many for each.
    first_keycode: u8,
    keysyms_per_keycode: usize,
    keysyms: Vec<u32>,
}

/// What X says went wrong.
pub type Outcome<T> = Result<T, Box<dyn std::error::Error>>;

impl User {
    /// In front of a screen.
    ///
    /// # Errors
    /// If there is no such screen.
    pub fn of(display: &str) -> Outcome<Self> {
        let (connection, number) = RustConnection::connect(Some(display))?;
        let setup = connection.setup();
        let (root, first_keycode) = (setup.roots[number].root, setup.min_keycode);
        let count = setup.max_keycode - first_keycode + 1;
        let mapping = connection.get_keyboard_mapping(first_keycode, count)?.reply()?;
        let keysyms_per_keycode = usize::from(mapping.keysyms_per_keycode);
        Ok(Self { connection, root, first_keycode, keysyms_per_keycode, keysyms: mapping.keysyms })
    }

    fn fake(&self, kind: u8, detail: u8, (x, y): (i16, i16)) -> Outcome<()> {
        self.connection.xtest_fake_input(kind, detail, 0, self.root, x, y, 0)?;
        // Answered only when the screen has done it: what a program has sent that ends at once may be lost, and a key stay down.
        self.connection.get_input_focus()?.reply()?;
        Ok(())
    }

    /// The mouse goes there, in pixels.
    ///
    /// # Errors
    /// If the screen is gone.
    pub fn point(&self, x: f32, y: f32) -> Outcome<()> {
        self.fake(MOTION_NOTIFY_EVENT, 0, (x.round() as i16, y.round() as i16))
    }

    /// What is under the mouse hears the keys from now on: there is no window manager to say so.
    ///
    /// # Errors
    /// If nothing is there.
    pub fn focus(&self) -> Outcome<()> {
        let window = self.connection.query_pointer(self.root)?.reply()?.child;
        self.connection.set_input_focus(InputFocus::PARENT, window, x11rb::CURRENT_TIME)?.check()?;
        Ok(())
    }

    /// Presses a button of the mouse, or releases it. Buttons 4 and 5 are the wheel.
    ///
    /// # Errors
    /// If the screen is gone.
    pub fn button(&self, button: u8, down: bool) -> Outcome<()> {
        self.fake(if down { BUTTON_PRESS_EVENT } else { BUTTON_RELEASE_EVENT }, button, (0, 0))
    }

    /// A click there with the left button, as slow as a hand.
    ///
    /// # Errors
    /// If the screen is gone.
    pub fn click(&self, x: f32, y: f32) -> Outcome<()> {
        self.point(x, y)?;
        pause(80);
        self.button(1, true)?;
        pause(60);
        self.button(1, false)?;
        pause(60);
        Ok(())
    }

    /// Presses and releases a key.
    ///
    /// # Errors
    /// If the keyboard does not have it.
    pub fn key(&self, key: Keysym) -> Outcome<()> {
        let at = self.keysyms.chunks(self.keysyms_per_keycode).position(|keysyms| keysyms.contains(&key.0));
        let code = self.first_keycode + u8::try_from(at.ok_or("the keyboard does not have this key")?)?;
        self.fake(KEY_PRESS_EVENT, code, (0, 0))?;
        pause(30);
        self.fake(KEY_RELEASE_EVENT, code, (0, 0))
    }

    /// The pixels of a part of the screen, row by row, as red, green and blue.
    ///
    /// # Errors
    /// If the screen is gone or the part is not on it.
    pub fn look(&self, x: i16, y: i16, width: u16, height: u16) -> Outcome<Vec<[u8; 3]>> {
        let image = self.connection.get_image(ImageFormat::Z_PIXMAP, self.root, x, y, width, height, !0)?.reply()?;
        // 32 bits a pixel, blue first: what Xvfb has at depth 24 on a little-endian machine.
        Ok(image.data.chunks_exact(4).map(|pixel| [pixel[2], pixel[1], pixel[0]]).collect())
    }
}

/// A hand takes its time.
pub fn pause(ms: u64) {
    std::thread::sleep(Duration::from_millis(ms));
}
