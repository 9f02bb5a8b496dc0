(** Closed forms of the states, once it is known which effects fire and by how much each of them changes its fluent: an
    atom has its last writer, a fluent is a sum of changes. *)

Require Import Reals QArith Qreals List Bool Lra Lia.
Require Import Spec States.
Import ListNotations.
Open Scope R_scope.

Section Closed.
Variable P : plan.
Variable g t : nat -> R.
Variable fired : effect -> bool.
Variable by_ : effect -> R.   (* an assignment, too, changes its fluent by something *)

Definition target (w : effect) : option nat :=
  match makes w with Increase f _ | Assign f _ => Some f | _ => None end.

Definition on (f : nat) (w : effect) : bool := match target w with Some h => Nat.eqb h f | None => false end.

(** All that fires at a time takes place. *)
Definition moved (time : R) (s : state) : state :=
  let now := filter (fun w => if Req_EM_T (t (point w)) time then fired w else false) (effects P) in
  {| holds := fun a => existsb (adds a) now || holds s a && negb (existsb (deletes a) now);
     value := fun f => value s f + sum (fun w => if on f w then by_ w else 0) now |}.

(** Whether a time point is over before (strict) or after a time. *)
Definition over (strict : bool) (p : nat) (time : R) : bool :=
  if strict then if Rlt_dec (t p) time then true else false else if Rle_dec (t p) time then true else false.

Lemma over_true strict p time : over strict p time = true <-> if strict then t p < time else t p <= time.
Proof. unfold over. destruct strict; [destruct Rlt_dec | destruct Rle_dec]; split; auto; easy. Qed.

Definition holds_at (strict : bool) (time : R) (a : nat) : bool :=
  existsb (Nat.eqb a) (true_at_first P) &&
    negb (existsb (fun d => deletes a d && fired d && over strict (point d) time) (effects P)) ||
  existsb (fun w => adds a w && fired w && over strict (point w) time &&
    negb (existsb (fun d => deletes a d && fired d && over strict (point d) time &&
      if Rlt_dec (t (point w)) (t (point d)) then true else false) (effects P))) (effects P).

Definition jumped (strict : bool) (time : R) (f : nat) (w : effect) : R :=
  if on f w then if fired w && over strict (point w) time then by_ w else 0 else 0.

Definition acted (time : R) (k : flow) : R := Rmax 0 (Rmin time (t (ends k)) - t (starts k)).

Definition flowed (time : R) (f : nat) (k : flow) : R :=
  if Nat.eqb (flows_to k) f then amount g t (initially P g t) (rate k) * acted time k else 0.

Definition value_at (strict : bool) (time : R) (f : nat) : R :=
  ev g t (value_at_first P f) + sum (jumped strict time f) (effects P) + sum (flowed time f) (flows P).

Definition closed (strict : bool) (time : R) : state :=
  {| holds := holds_at strict time; value := value_at strict time |}.

Lemma effect_happens w : In w (effects P) -> In (point w) (happenings P).
Proof. intros H. unfold happenings. apply in_or_app. left. now apply in_map. Qed.

(** The last writer of an atom, said with propositions. *)
Definition takes (kind : nat -> effect -> bool) (a : nat) (w : effect) : Prop :=
  In w (effects P) /\ kind a w = true /\ fired w = true.

Lemma some_takes kind a (b : effect -> bool) :
  existsb (fun w => kind a w && fired w && b w) (effects P) = true <-> exists w, takes kind a w /\ b w = true.
Proof using P fired.
  rewrite existsb_exists. unfold takes. split.
  - intros [w [I H]]. rewrite !andb_true_iff in H. destruct H as [[K F] B]. now exists w.
  - intros [w [[I [K F]] B]]. exists w. rewrite K, F, B. auto.
Qed.

Lemma holds_at_true strict time a : holds_at strict time a = true <->
  (In a (true_at_first P) /\ forall d, takes deletes a d -> over strict (point d) time = false) \/
  exists w, takes adds a w /\ over strict (point w) time = true /\
    forall d, takes deletes a d -> over strict (point d) time = true -> ~ t (point w) < t (point d).
Proof using P t fired.
  unfold holds_at. rewrite orb_true_iff, andb_true_iff, negb_true_iff.
  assert (D : existsb (fun d => deletes a d && fired d && over strict (point d) time) (effects P) = false <->
    forall d, takes deletes a d -> over strict (point d) time = false).
  { rewrite <- not_true_iff_false, some_takes. split.
    - intros N d T. apply not_true_iff_false. intros O. apply N. eauto.
    - intros N [d [T O]]. apply N in T. congruence. }
  rewrite listed_true, D. apply or_iff_compat_l.
  rewrite existsb_exists. split.
  - intros [w [J H]]. rewrite !andb_true_iff, negb_true_iff in H. destruct H as [[[K F] O] N].
    exists w. split; [now split|]. split; auto. intros d [DI [DK DF]] DO L. apply not_true_iff_false in N. apply N.
    apply existsb_exists. exists d. rewrite DK, DF, DO. split; auto. destruct Rlt_dec; auto.
  - intros [w [[J [K F]] [O N]]]. exists w. split; auto. rewrite K, F, O. simpl. apply negb_true_iff, not_true_iff_false.
    intros H. apply existsb_exists in H as [d [DI H]]. rewrite !andb_true_iff in H. destruct H as [[[DK DF] DO] L].
    destruct Rlt_dec; [|easy]. apply (N d); auto. now split.
Qed.

Lemma closed_first time : (forall p, In p (happenings P) -> time <= t p) -> same (closed true time) (initially P g t).
Proof.
  intros H. split.
  - intros a. apply iff_bool. simpl. rewrite holds_at_true, existsb_exists.
    assert (O : forall w kind, takes kind a w -> over true (point w) time = false).
    { intros w kind [I _]. apply not_true_iff_false. intros O. apply over_true in O. apply effect_happens, H in I. lra. }
    split.
    + intros [[A _] | [w [T [B _]]]]; [exists a; split; auto; apply Nat.eqb_refl|]. apply O in T. congruence.
    + intros [x [A E]]. apply Nat.eqb_eq in E. subst x. left. split; eauto.
  - intros f. simpl. unfold value_at. rewrite !sum_zero; try lra.
    + intros k K. unfold flowed, acted. destruct Nat.eqb; auto. pose proof (H _ (start_happens _ _ K)).
      rewrite Rmax_left; try lra. pose proof (Rmin_l time (t (ends k))). lra.
    + intros w W. unfold jumped. destruct (on f w); auto. destruct (over true (point w) time) eqn:O;
      [|now rewrite andb_false_r]. apply over_true in O. apply effect_happens, H in W. lra.
Qed.

Lemma closed_times time : same (closed false time) (moved time (closed true time)).
Proof.
  split.
  - intros a. apply iff_bool. simpl.
    assert (K : forall kind, existsb (kind a) (filter (fun w => if Req_EM_T (t (point w)) time then fired w else false)
        (effects P)) = true <-> exists w, takes kind a w /\ t (point w) = time).
    { intros kind. rewrite existsb_exists. split.
      - intros [w [I A]]. apply filter_In in I as [I F]. destruct Req_EM_T; [|easy]. exists w. split; auto. now split.
      - intros [w [[I [A F]] E]]. exists w. split; auto. apply filter_In. split; auto. destruct Req_EM_T; easy. }
    rewrite orb_true_iff, andb_true_iff, negb_true_iff, <- (not_true_iff_false (existsb (deletes a) _)), !K, !holds_at_true.
    clear K.
    assert (E : forall w, over false (point w) time = true <-> over true (point w) time = true \/ t (point w) = time).
    { intros w. rewrite !over_true. lra. }
    assert (O : forall w, over true (point w) time = true <-> t (point w) < time) by (intros w; apply over_true).
    assert (N : forall w, over false (point w) time = false <-> time < t (point w)).
    { intros w. rewrite <- not_true_iff_false, over_true. lra. }
    assert (N' : forall w, over true (point w) time = false <-> time <= t (point w)).
    { intros w. rewrite <- not_true_iff_false, over_true. lra. }
    split.
    + intros [[A B] | [p [A [B C]]]].
      * right. split.
        -- left. split; auto. intros d D. apply B, N in D. apply N'. lra.
        -- intros [d [D F]]. apply B, N in D. lra.
      * destruct (Req_EM_T (t (point p)) time) as [F | F]; [left; eauto | right]. apply E in B as [B|B]; [|easy].
        pose proof B as B'. apply O in B'. split.
        -- right. exists p. split; auto. split; auto. intros d D G. apply C; auto. apply E. auto.
        -- intros [d [D G]]. apply (C d D); [apply E; auto | lra].
    + intros [[p [A B]] | [[[A B] | [p [A [B C]]]] M]].
      * right. exists p. split; auto. split; [apply E; auto|]. intros d D F L. apply over_true in F. lra.
      * left. split; auto. intros d D. pose proof (B _ D) as F. apply N' in F. apply N.
        destruct (Req_EM_T (t (point d)) time); [exfalso; eauto | lra].
      * right. exists p. split; auto. split; [apply E; auto|]. intros d D F.
        apply E in F as [F|F]; [auto | exfalso; eauto].
  - intros f. simpl. unfold value_at. enough (E : sum (jumped false time f) (effects P) =
      sum (jumped true time f) (effects P) + sum (fun w => if on f w then by_ w else 0)
        (filter (fun w => if Req_EM_T (t (point w)) time then fired w else false) (effects P))) by lra.
    rewrite sum_filter, <- sum_plus. apply sum_ext. intros w _. unfold jumped, over.
    destruct (on f w); [|destruct Req_EM_T; try destruct (fired w); lra].
    destruct (fired w); simpl; [|destruct Req_EM_T; lra].
    destruct (Rle_dec (t (point w)) time), (Rlt_dec (t (point w)) time), (Req_EM_T (t (point w)) time); try lra; exfalso; lra.
Qed.

Lemma closed_between from until : from < until -> (forall p, In p (happenings P) -> ~ from < t p < until) ->
  same (closed true until) (drifted P g t from until (closed false from)).
Proof.
  intros L N. assert (O : forall w, In w (effects P) -> over true (point w) until = over false (point w) from).
  { intros w H. apply iff_bool. rewrite !over_true. apply effect_happens, N in H. lra. }
  split.
  - intros a. apply iff_bool. simpl. rewrite !holds_at_true.
    assert (T : forall kind w, takes kind a w -> over true (point w) until = over false (point w) from)
      by (intros kind w [I _]; auto).
    apply Morphisms_Prop.or_iff_morphism.
    + split; intros [A B]; (split; [exact A|]); intros d D; pose proof (T _ _ D); specialize (B _ D); congruence.
    + split; intros [w [A [B C]]]; exists w; (split; [exact A|]); pose proof (T _ _ A);
      (split; [congruence|]); intros d D; pose proof (T _ _ D); intros F; apply C; congruence.
  - intros f. simpl. unfold value_at.
    rewrite (sum_ext (jumped true until f) (jumped false from f)) by (intros w W; unfold jumped; now rewrite (O _ W)).
    assert (K : sum (flowed until f) (flows P) =
      sum (flowed from f) (flows P) + (until - from) * sum (slope P g t from until f) (flows P)).
    { rewrite <- sum_scale, <- sum_plus. apply sum_ext. intros k H. cbv beta. unfold flowed, slope.
      destruct (Nat.eqb (flows_to k) f); [|ring].
      assert (S : t (starts k) <= from \/ until <= t (starts k)) by (pose proof (N _ (start_happens _ _ H)); lra).
      assert (U : t (ends k) <= from \/ until <= t (ends k)) by (pose proof (N _ (end_happens _ _ H)); lra).
      assert (E : acted until k = acted from k +
        (if Rle_dec (t (starts k)) from then if Rle_dec until (t (ends k)) then until - from else 0 else 0)).
      { unfold acted, Rmax, Rmin. destruct S, U;
        repeat match goal with |- context [Rle_dec ?a ?b] =>
          lazymatch b with context [Rle_dec _ _] => fail | _ => destruct (Rle_dec a b) end end; try lra; exfalso; lra. }
      rewrite E. repeat destruct Rle_dec; ring. }
    lra.
Qed.

Theorem closed_runs : runs P g t moved (closed true) (closed false).
Proof. constructor; auto using closed_first, closed_times, closed_between. Qed.

Lemma moved_same time s s' : same s s' -> same (moved time s) (moved time s').
Proof. intros [A V]. split; simpl; intros; [now rewrite A | now rewrite V]. Qed.

End Closed.
