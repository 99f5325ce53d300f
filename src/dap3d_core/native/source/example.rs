// Runs the model and writes its first outputs: rustc -L @FIRST@ example.rs -o example

use std::ffi::{c_char, c_double, c_int, c_void, CStr};

#[link(name = "@NAME@", kind = "static")]
extern "C" {
    fn dap3d_create(t_end: c_double) -> *mut c_void;
    fn dap3d_free(model: *mut c_void);
    fn dap3d_step_to(model: *mut c_void, t: c_double) -> c_int;
    fn dap3d_get(model: *mut c_void, variable: c_int) -> c_double;
    fn dap3d_count() -> c_int;
    fn dap3d_kind(variable: c_int) -> c_int;
    fn dap3d_name(variable: c_int) -> *const c_char;
    fn dap3d_message(model: *const c_void) -> *const c_char;
}

#[link(name = "m")]
extern "C" {}

const OUTPUT: c_int = 3;

fn main() {
    let t_end = @T_END@;
    unsafe {
        let model = dap3d_create(t_end);
        let outputs: Vec<c_int> = (0..dap3d_count()).filter(|&v| dap3d_kind(v) == OUTPUT).collect();
        for k in 0..=10 {
            let t = if k == 10 { t_end } else { t_end / 10.0 * k as f64 };
            if dap3d_step_to(model, t) < 0 {
                panic!("{}", CStr::from_ptr(dap3d_message(model)).to_string_lossy());
            }
            for &v in &outputs {
                let name = CStr::from_ptr(dap3d_name(v)).to_string_lossy();
                println!("{t:?} {name} {:?}", dap3d_get(model, v));
            }
        }
        dap3d_free(model);
    }
}
